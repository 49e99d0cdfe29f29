"""The simulator node: lockstep, real time, resets, views, and commands that must not be used."""

import math
from time import monotonic

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fbql_common.core.topic_names import BALL_POSE, CLOCK, DIAGNOSTICS, ROBOT_POSE, WALL_POSE, WHEEL_COMMAND, WORLD
from fbql_common.core.types import WheelCommand, World
from fbql_common.qos import POSE_QOS, STEP_QOS
from fbql_common.spin import FAILED
from fbql_common.wire import NS, encode_command
from fbql_msgs.msg import WheelCommand as WheelCommandMsg
from fbql_msgs.srv import ResetEpisode
from fbql_sim.core.world_loop import WorldLoop
from fbql_sim.simulator_node import SimulatorNode
from geometry_msgs.msg import PoseStamped
from hand_driven import Partner, listen
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from visualization_msgs.msg import MarkerArray

RESET = "simulator/reset_episode"


class Match:
    """A simulator and a partner that receives the world states and publishes commands."""

    def __init__(self, bench, **parameters):
        self.bench = bench
        self.simulator = bench.add(SimulatorNode, **parameters)
        self.partner = bench.add(Partner)
        self.worlds = listen(self.partner, World, WORLD)
        self.publisher = self.partner.create_publisher(WheelCommandMsg, WHEEL_COMMAND, STEP_QOS)
        bench.until(lambda: self.publisher.get_subscription_count() == 1, "the simulator to hear commands")
        bench.until(lambda: self.worlds, "the first world state")

    def reset(self, episode=0, seed=1):
        """Requests an episode, and waits for its world state."""
        answer = self.bench.call(self.partner, ResetEpisode, RESET, episode=episode, seed=seed)
        self.bench.until(lambda: self.worlds[-1].episode == max(episode, -1), f"episode {episode}")
        return answer

    def command(self, world, left=50.0, right=50.0, **fields):
        """Publishes a command that answers a world state."""
        command = WheelCommand(*world[:3], left, right)._replace(**fields)
        self.publisher.publish(encode_command(command))

    def step(self):
        """Answers the last world state and waits for the next."""
        world = self.worlds[-1]
        self.command(world)
        self.bench.until(lambda: self.worlds[-1].step == world.step + 1, f"step {world.step + 1}")


@pytest.fixture
def lockstep(bench):
    return Match(bench, request_period_s=0.05)


@pytest.fixture
def realtime(bench):
    return Match(bench, realtime=1.0)


def test_world_that_is_not_answered_is_published_again_with_the_same_bytes(bench, lockstep):
    lockstep.reset()
    lockstep.step()
    heard = lockstep.worlds.data
    last, count = heard[-1], len(heard)
    bench.until(lambda: len(heard) >= count + 4, "the world state to be published four times more")
    assert heard[count:] == [last] * (len(heard) - count)
    assert not lockstep.simulator.finished.done(), "by default the simulator waits for ever"


def test_lockstep_plays_what_the_world_loop_plays_in_process(lockstep):
    lockstep.reset(episode=3, seed=11)
    loop = WorldLoop()
    expected = [loop.reset(3, 11)]
    for _ in range(20):
        lockstep.step()
        expected.append(loop.step(50.0, 50.0))
    played = {world.step: world for world in lockstep.worlds if world.episode == 3}
    # Times count every world state since the node began, the one before the reset too.
    assert [played[step][1:] for step in range(21)] == [world[1:] for world in expected]


def test_command_that_comes_twice_steps_once(bench, lockstep):
    lockstep.reset()
    lockstep.command(lockstep.worlds[-1])
    lockstep.command(lockstep.worlds[-1])
    bench.until(lambda: lockstep.worlds[-1].step == 1, "step 1")
    lockstep.step()
    assert lockstep.worlds[-1].step == 2
    assert sorted({world.step for world in lockstep.worlds if world.episode == 0}) == [0, 1, 2]


def test_command_for_a_step_to_come_is_dropped_and_said(bench, lockstep):
    lockstep.reset()
    world = lockstep.worlds[-1]
    lockstep.command(world, step=5, stamp_ns=world.stamp_ns + 10**9)
    bench.until_said("step 5, which has not been reached yet")
    assert lockstep.worlds[-1].step == 0


def test_command_of_an_earlier_play_of_the_episode_steps_nothing(bench, lockstep):
    """Fault 4."""
    lockstep.reset(episode=4, seed=9)
    begun = lockstep.worlds[-1]
    lockstep.step()
    lockstep.reset(episode=4, seed=9)
    bench.until(lambda: lockstep.worlds[-1].step == 0, "step 0")
    lockstep.command(begun, -50.0, 50.0)
    bench.until_said("the command for step 0 has the stamp of another world state (1 dropped so far)")
    assert lockstep.worlds[-1].step == 0
    lockstep.step()
    straight = WorldLoop()
    straight.reset(4, 9)
    assert lockstep.worlds[-1][1:] == straight.step(50.0, 50.0)[1:]


@pytest.mark.parametrize("realtime", [0.0, 1.0])
def test_command_without_a_stamp_is_driven_and_warned_of_once(bench, realtime):
    """Fault 6, as a person sends it by `ros2 topic pub`."""
    match = Match(bench, realtime=realtime)
    match.reset()

    def drives():
        match.command(match.worlds[-1], stamp_ns=0)
        return match.worlds[-1].step >= 2 and match.worlds[-1].robot_speed_m_s > 0.1

    bench.until(drives, "the robot to move")
    assert bench.said().count("/wheel_command: a message has no stamp (reported once)") == 1
    assert "dropped" not in bench.said()


@pytest.mark.parametrize("bad", [math.nan, -math.inf])
def test_command_that_is_not_finite_is_dropped_and_counted(bench, lockstep, bad):
    lockstep.reset()
    world = lockstep.worlds[-1]
    message = WheelCommandMsg(episode=world.episode, step=world.step, left_rad_s=bad, right_rad_s=1.0)
    message.header.frame_id = "field"
    lockstep.publisher.publish(message)
    bench.until_said("a wheel velocity is not finite (1 dropped so far)")
    lockstep.publisher.publish(message)
    lockstep.step()  # in order behind the second one, and the only one that is acted on
    assert lockstep.worlds[-1].step == 1
    assert bench.said().count("not finite") == 1, "warned again within a second"


def test_bytes_that_are_not_a_command_are_dropped(bench, lockstep):
    lockstep.reset()
    lockstep.publisher.publish(b"\x00\x01\x00\x00garbage")
    bench.until_said("malformed")
    lockstep.step()
    assert lockstep.worlds[-1].step == 1


def test_absurd_but_finite_command_moves_the_robot_no_faster_than_it_can(lockstep):
    lockstep.reset()
    lockstep.command(lockstep.worlds[-1], left=8e307, right=8e307)
    lockstep.bench.until(lambda: lockstep.worlds[-1].step == 1, "step 1")
    assert 0 < lockstep.worlds[-1].robot_speed_m_s <= 1.76


def test_asking_twice_for_an_episode_before_its_first_step_changes_nothing(lockstep):
    assert lockstep.reset(episode=4, seed=9).success
    begun = lockstep.worlds.data[-1]
    count = len(lockstep.worlds)
    assert lockstep.reset(episode=4, seed=9).success
    lockstep.bench.until(lambda: len(lockstep.worlds) > count, "the world state again")
    assert lockstep.worlds.data[-1] == begun


def test_asking_again_after_the_first_step_begins_anew(lockstep):
    lockstep.reset(episode=4, seed=9)
    begun = lockstep.worlds[-1]
    lockstep.step()
    lockstep.reset(episode=4, seed=9)
    lockstep.bench.until(lambda: lockstep.worlds[-1].step == 0, "step 0")
    again = lockstep.worlds[-1]
    assert again[1:] == begun[1:]
    assert again.stamp_ns > begun.stamp_ns, "simulated time never goes back"


@pytest.mark.parametrize(("episode", "seed"), [(-1, 0), (0, -1), (-(2**63), -(2**63))])
def test_bad_reset_is_refused_with_the_reason_and_changes_nothing(lockstep, episode, seed):
    lockstep.reset(episode=2, seed=5)
    before = lockstep.worlds.data[-1]
    answer = lockstep.bench.call(lockstep.partner, ResetEpisode, RESET, episode=episode, seed=seed)
    assert not answer.success
    assert str(episode) in answer.message and str(seed) in answer.message
    count = len(lockstep.worlds)
    lockstep.bench.until(lambda: len(lockstep.worlds) > count, "the world state again")
    assert lockstep.worlds.data[-1] == before


def test_largest_seed_is_taken(lockstep):
    assert lockstep.reset(episode=1, seed=2**63 - 1).success


def test_ended_world_waits_for_a_reset(bench):
    match = Match(bench, request_period_s=0.05, max_steps=2)
    match.reset()
    match.step()
    match.step()
    assert match.worlds[-1].truncated
    count = len(match.worlds)
    match.command(match.worlds[-1])
    bench.until(lambda: len(match.worlds) >= count + 2, "the ended world state twice more")
    assert match.worlds[-1].step == 2
    match.reset(episode=1)
    assert (match.worlds[-1].step, match.worlds[-1].truncated) == (0, False)


def test_lockstep_without_commands_ends_the_run_naming_the_topic(bench):
    match = Match(bench, lockstep_timeout_s=0.1, request_period_s=0.02)
    match.reset(episode=7)
    bench.until(match.simulator.finished.done, "the run to end")
    assert match.simulator.finished.result() == FAILED
    assert f"no command on {bench.namespace}/wheel_command for episode 7, step 0 within 0.1 s" in bench.said()


def test_idle_field_can_be_driven_by_hand(lockstep):
    lockstep.step()
    assert (lockstep.worlds[-1].episode, lockstep.worlds[-1].step) == (-1, 1)


# Real time


def test_real_time_steps_by_itself_and_without_commands_at_rest(bench, realtime):
    bench.until(lambda: realtime.worlds[-1].step >= 5, "five steps")
    assert all(world.robot_speed_m_s == 0.0 for world in realtime.worlds)
    assert [world.step for world in realtime.worlds[1:]] == [world.step + 1 for world in realtime.worlds[:-1]]


def test_wheels_stop_in_real_time_when_commands_stop(bench, realtime):
    realtime.reset()
    while max(world.robot_speed_m_s for world in realtime.worlds) < 0.2:
        count = len(realtime.worlds)
        realtime.command(realtime.worlds[-1], 20.0, 20.0)
        bench.until(lambda count=count: len(realtime.worlds) > count, "the next step")
    last = realtime.worlds[-1]
    realtime.command(last, 20.0, 20.0)
    bench.until(lambda: realtime.worlds[-1].robot_speed_m_s < 0.01, "the robot to stand", 3.0)
    bench.until_said("no command for 0.25 s: the wheels are stopped")
    driven = [world for world in realtime.worlds if world.stamp_ns > last.stamp_ns and world.robot_speed_m_s > 0.2]
    assert 0.1 * NS < driven[-1].stamp_ns - last.stamp_ns < 1.0 * NS, "a command counts for about command_timeout_s"
    realtime.command(realtime.worlds[-1], 20.0, 20.0)
    bench.until_said("commands come again: the wheels turn")


def test_command_whose_stamp_is_too_old_is_not_driven_in_real_time(bench, realtime):
    realtime.reset()
    first = realtime.worlds[-1]
    bench.until(lambda: realtime.worlds[-1].stamp_ns > first.stamp_ns + 0.3 * NS, "0.3 s of simulated time")
    realtime.command(first)
    bench.until_said("the command's stamp is 0.3")
    assert realtime.worlds[-1].robot_speed_m_s == 0.0


def test_command_whose_stamp_is_in_the_future_is_not_driven_in_real_time(bench, realtime):
    realtime.reset()
    world = realtime.worlds[-1]
    realtime.command(world, stamp_ns=world.stamp_ns + 5 * NS)
    bench.until_said("s ahead of simulated time")
    assert realtime.worlds[-1].robot_speed_m_s == 0.0


def test_of_a_burst_of_commands_only_the_newest_is_driven(bench, realtime):
    """As they come when fusion has stood still: the robot must not turn by one after the other."""
    realtime.reset()
    first = realtime.worlds[-1]
    bench.until(lambda: realtime.worlds[-1].step >= first.step + 9, "ten steps")
    burst = realtime.worlds[-10:]
    for world in burst[:-1]:
        realtime.command(world, -50.0, -50.0)
    realtime.command(burst[-1], 50.0, 50.0)
    after = len(realtime.worlds)
    bench.until(lambda: len(realtime.worlds) > after + 6, "steps after the burst")
    speeds = [world.robot_speed_m_s for world in realtime.worlds[after:]]
    assert min(speeds) >= 0.0 and max(speeds) > 0.0, speeds


def test_a_simulator_that_has_stood_still_makes_up_for_nothing(bench, realtime):
    """Missed ticks are counted; a burst of world states would make the world rush."""
    realtime.reset()
    bench.until(lambda: realtime.worlds[-1].step >= 2, "two steps")
    until_s = monotonic() + 0.5
    while monotonic() < until_s:  # nothing is spun
        pass
    before = realtime.worlds[-1].step
    bench.until(lambda: realtime.worlds[-1].step > before, "the next step")
    begun_s = monotonic()
    first = realtime.worlds[-1].step
    bench.until(lambda: realtime.worlds[-1].step >= first + 6, "six more steps")
    assert monotonic() - begun_s > 3 / 60, "six steps take a tenth of a second"
    assert realtime.simulator._counts()["missed_ticks"] >= 20


def test_command_of_the_episode_before_is_not_driven_in_real_time(bench, realtime):
    realtime.reset(episode=0)
    old = realtime.worlds[-1]
    realtime.command(old)
    bench.until(lambda: realtime.worlds[-1].robot_speed_m_s > 0, "the robot to move")
    realtime.reset(episode=1)
    realtime.command(old)
    bench.until(lambda: realtime.worlds[-1].step >= 5, "five steps")
    assert all(world.robot_speed_m_s == 0.0 for world in realtime.worlds if world.episode == 1)


def test_command_that_comes_out_of_order_is_not_driven_in_real_time(bench, realtime):
    realtime.reset()
    first = realtime.worlds[-1]
    bench.until(lambda: realtime.worlds[-1].step > first.step, "the next step")
    realtime.command(realtime.worlds[-1], 30.0, 30.0)
    realtime.command(first, -30.0, -30.0)
    bench.until_said(f"the command for step {first.step} is older than the last")


def test_slow_motion_drives(bench):
    match = Match(bench, realtime=0.25, command_timeout_s=0.05)
    match.reset()

    def answer_and_look():
        if match.worlds[-1] is not match.worlds[answer_and_look.answered]:
            answer_and_look.answered = len(match.worlds) - 1
            match.command(match.worlds[-1])
        return match.worlds[-1].step >= 4

    answer_and_look.answered = 0
    bench.until(answer_and_look, "four steps")
    assert match.worlds[-1].robot_speed_m_s > 0.1, "a command of the last step was taken for too old"


# Views


def published(monkeypatch):
    """The topics that nodes publish on from now on, in order."""
    topics = []
    publish = Publisher.publish

    def note(self, message):
        topics.append(self.topic_name)
        publish(self, message)

    monkeypatch.setattr(Publisher, "publish", note)
    return topics


def test_lockstep_publishes_views_only_to_those_who_look(bench, lockstep, monkeypatch):
    lockstep.reset()
    topics = published(monkeypatch)
    for _ in range(5):
        lockstep.step()
    assert f"{bench.namespace}/world" in topics
    views = {
        CLOCK,
        *(f"{bench.namespace}/{topic}" for topic in (ROBOT_POSE, BALL_POSE, WALL_POSE, "simulator/markers")),
    }
    assert not views & set(topics)

    heard = {}
    for kind, topic in [(Clock, CLOCK), (PoseStamped, ROBOT_POSE), (PoseStamped, BALL_POSE), (PoseStamped, WALL_POSE)]:
        lockstep.partner.create_subscription(kind, topic, lambda m, t=topic: heard.__setitem__(t, m), POSE_QOS)
    lockstep.partner.create_subscription(
        MarkerArray, "simulator/markers", lambda m: heard.__setitem__("markers", m), POSE_QOS
    )
    bench.until(lambda: len(heard) == 5, f"every view; came: {list(heard)}")
    lockstep.step()
    world = lockstep.worlds[-1]

    def stamp_ns(stamp):
        return stamp.sec * NS + stamp.nanosec

    bench.until(
        lambda: all(
            stamp_ns(stamp) == world.stamp_ns
            for stamp in (heard[CLOCK].clock, heard[WALL_POSE].header.stamp, heard["markers"].markers[0].header.stamp)
        ),
        "the views of the last step",
    )
    robot, ball, wall = heard[ROBOT_POSE], heard[BALL_POSE], heard[WALL_POSE]
    assert {pose.header.frame_id for pose in (robot, ball, wall)} == {"field"}
    assert (robot.pose.position.x, robot.pose.position.y) == (world.robot_x_m, world.robot_y_m)
    assert (ball.pose.position.x, ball.pose.position.y) == (world.ball_x_m, world.ball_y_m)
    assert (wall.pose.position.x, wall.pose.position.y) == (world.wall_x_m, world.wall_y_m)
    yaw = 2 * math.atan2(robot.pose.orientation.z, robot.pose.orientation.w)
    assert yaw == pytest.approx(world.robot_yaw_rad)
    names = [marker.ns for marker in heard["markers"].markers]
    assert len(names) == len(set(names)) == 6


def test_real_time_publishes_poses_and_clock_whether_or_not_somebody_looks(bench, monkeypatch):
    topics = published(monkeypatch)
    Match(bench, realtime=1.0)
    expected = {CLOCK, *(f"{bench.namespace}/{topic}" for topic in (ROBOT_POSE, BALL_POSE, WALL_POSE))}
    bench.until(lambda: expected <= set(topics), "poses and /clock")


def test_diagnostics_tell_the_step_and_warn_of_dropped_commands(bench, lockstep):
    statuses = []
    lockstep.partner.create_subscription(DiagnosticArray, DIAGNOSTICS, lambda m: statuses.extend(m.status), POSE_QOS)
    lockstep.reset(episode=6)
    lockstep.step()

    def last():
        return {pair.key: pair.value for pair in statuses[-1].values} if statuses else {}

    bench.until(lambda: (last().get("episode"), last().get("step")) == ("6", "1"), "diagnostics of episode 6, step 1")
    assert statuses[-1].name == f"{bench.namespace[1:]}/simulator: world"
    assert statuses[-1].level == DiagnosticStatus.OK
    lockstep.publisher.publish(b"garbage")
    bench.until(lambda: last()["commands_dropped"] == "1", "the dropped command to be counted")
    assert statuses[-1].level == DiagnosticStatus.WARN


# Publishers that do not fit


def test_publisher_of_other_qos_is_an_error_that_names_topic_and_policy(bench):
    bench.add(SimulatorNode)
    stray = bench.add(Partner)
    stray.create_publisher(
        WheelCommandMsg, WHEEL_COMMAND, QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    )
    bench.until_said("incompatible in RELIABILITY")
    line = next(line for line in bench.said().splitlines() if "RELIABILITY" in line and "[ERROR]" in line)
    assert "[ERROR]" in line and f"{bench.namespace}/wheel_command" in line


def test_publisher_of_another_type_is_an_error_that_names_topic_and_types(bench, other_bench):
    bench.add(SimulatorNode, request_period_s=0.05)
    stray = other_bench.add(Partner, "stray")
    stray.create_publisher(PoseStamped, WHEEL_COMMAND, STEP_QOS)
    bench.until_said("expected fbql_msgs/msg/WheelCommand")
    line = next(line for line in bench.said().splitlines() if "expected fbql_msgs" in line)
    assert "[ERROR]" in line
    assert f"{bench.namespace}/wheel_command: " in line and "publishes geometry_msgs/msg/PoseStamped" in line
