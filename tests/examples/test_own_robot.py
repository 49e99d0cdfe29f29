"""What docs/your-own-robot.md starts: the robot that stands in for one's own, and the task that says when its goal is reached."""

from __future__ import annotations

from math import atan2, hypot, inf, nan, pi

import pytest
from fbql_common.core.mux_types import RobotOutcome
from fbql_common.core.twist import Twist
from fbql_common.qos import COMMAND_QOS, STEP_QOS
from fbql_common.wire import MESSAGES, decode_outcome, encode_twist
from fbql_studies.rooms.maps import room_of
from geometry_msgs.msg import Vector3Stamped
from hand_driven import Partner
from nav_msgs.msg import Odometry
from places import ROOT
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan

THERE, HERE = (4.0, 0.0), (0.0, 3.0)


@pytest.fixture(autouse=True)
def example(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its files are imported as they import each other."""
    monkeypatch.syspath_prepend(str(ROOT / "examples" / "rooms"))


class Tasked:
    """The task, and a partner that is its robot."""

    def __init__(self, bench, **parameters):
        from task import TaskNode

        self.bench = bench
        places = {"there_x_m": THERE[0], "there_y_m": THERE[1], "here_x_m": HERE[0], "here_y_m": HERE[1]}
        node = bench.add(TaskNode, **places, **parameters)
        partner = bench.add(Partner)
        self.goals, self.outcomes = [], []
        partner.create_subscription(Vector3Stamped, "goal", self.goals.append, qos_profile_sensor_data)
        partner.create_subscription(
            MESSAGES[RobotOutcome],
            "outcome",
            lambda data: self.outcomes.append(decode_outcome(data)),
            STEP_QOS,
            raw=True,
        )
        self._scans = partner.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        self._odometry = partner.create_publisher(Odometry, "odom", qos_profile_sensor_data)
        # A publisher may know of the task before the task knows of it; what it publishes then is lost.
        for publisher, message, has_come in (
            (self._scans, LaserScan(ranges=[inf, inf, 9.0]), lambda: node._nearest_m == 9.0),
            (self._odometry, Odometry(), lambda: self.goals),
        ):
            bench.until(
                lambda p=publisher, m=message, c=has_come: p.publish(m) or c(), "the task and its robot to meet"
            )
        for _ in range(20):
            bench.spin()  # the rest of it
        assert self.outcomes == []

    def at(self, x, y, nearest_m=inf):
        """Puts the robot there, facing +y; returns what the task says: a goal as (distance, bearing), or an outcome."""
        before = len(self.goals) + len(self.outcomes)
        self._scans.publish(LaserScan(ranges=[nearest_m, inf]))
        odometry = Odometry()
        odometry.pose.pose.position.x, odometry.pose.pose.position.y = x, y
        odometry.pose.pose.orientation.z = odometry.pose.pose.orientation.w = 0.5**0.5
        outcomes = len(self.outcomes)
        self._odometry.publish(odometry)
        self.bench.until(lambda: len(self.goals) + len(self.outcomes) > before, "an answer")
        if len(self.outcomes) > outcomes:
            return self.outcomes[-1]
        return pytest.approx((self.goals[-1].vector.x, self.goals[-1].vector.y))


def test_a_goal_that_is_reached_is_a_success_and_the_other_place_is_next(bench):
    task = Tasked(bench)
    assert task.at(0.0, 0.0) == (4.0, -pi / 2)
    reached = task.at(3.8, 0.0)
    assert (reached.reward, reached.terminated, reached.outcome) == (10.0, True, "success")
    assert task.at(3.8, 3.0) == (3.8, pi / 2)
    assert task.at(*HERE).outcome == "success"
    assert task.at(*HERE) == (5.0, -pi / 2 - atan2(3.0, 4.0))


def test_a_touch_is_one_collision_however_long_it_lasts_and_the_goal_stays(bench):
    task = Tasked(bench)
    collided = task.at(1.0, 0.0, 0.1)
    assert (collided.reward, collided.terminated, collided.outcome) == (-10.0, True, "collision")
    assert task.at(1.0, 0.0, 0.1) == (3.0, -pi / 2)
    assert task.at(1.0, 0.0, 0.5) == (3.0, -pi / 2)
    assert task.at(1.0, 0.0, 0.1).outcome == "collision"


def test_an_episode_whose_time_is_up_is_truncated_and_the_goal_stays(bench):
    task = Tasked(bench, limit_s=1.0)
    task.at(0.0, 0.0)
    bench.until(lambda: isinstance(task.at(0.0, 0.0), RobotOutcome), "the time to be up")
    (ended,) = task.outcomes
    assert (ended.reward, ended.terminated, ended.truncated, ended.outcome) == (0.0, False, True, "")
    assert task.at(0.0, 0.0) == (4.0, -pi / 2)


def test_the_robot_drives_as_it_is_commanded_and_stops_without_commands(bench):
    pytest.importorskip("irsim", reason="IR-SIM is in requirements/rooms.txt")
    from robot import Robot

    start = room_of("traps", 700_001).start
    partner = bench.add(Partner)
    poses, scans = [], []
    partner.create_subscription(
        Odometry,
        "odom",
        lambda m: poses.append((m.pose.pose.position.x, m.pose.pose.position.y)),
        qos_profile_sensor_data,
    )
    partner.create_subscription(LaserScan, "scan", scans.append, qos_profile_sensor_data)
    commands = partner.create_publisher(MESSAGES[Twist], "cmd_vel", COMMAND_QOS)
    robot = bench.add(Robot, room=700_001)
    bench.until(lambda: poses and scans, "the robot's sensors")
    assert poses[0] == pytest.approx(start[:2])
    assert len(scans[0].ranges) == 72
    bench.until(commands.get_subscription_count, "the robot to listen")
    commands.publish(encode_twist(Twist(linear_x_m_s=0.2)))
    bench.until(lambda: hypot(poses[-1][0] - start[0], poses[-1][1] - start[1]) > 0.05, "the robot to drive")
    bench.until(lambda: len(poses) > 12 and len(set(poses[-5:])) == 1, "the robot to stop")
    commands.publish(encode_twist(Twist(linear_x_m_s=nan)))
    bench.until(lambda: robot._commands.dropped, "a command that is no number to be dropped")
    before = len(poses)
    bench.until(lambda: len(poses) > before + 2, "the robot to live on")
    assert poses[-1] == poses[before - 1]
