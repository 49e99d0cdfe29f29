"""The mux node: a file for twist_mux works unchanged, commands go through byte for byte, and an error is one line."""

import math
from time import monotonic

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from fbql_common.core.errors import BadInput
from fbql_common.core.topic_names import CLOCK, DIAGNOSTICS
from fbql_common.core.twist import StampedTwist, Twist
from fbql_common.qos import POSE_QOS
from fbql_common.wire import MESSAGES, encode_stamped_twist, encode_twist
from fbql_fusion.twist_mux_node import TwistMuxNode
from hand_driven import Partner
from mux_bench import TWO_SOURCES, OwnMux, Sources
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock

NAV, JOY, PAUSE = "nav_vel", "joy_vel", "pause_navigation"
SLOW, FAST = Twist(0.1, 0.2, 0.3, 0.4, 0.5, 0.6), Twist(linear_x_m_s=0.8)
STAMPED = TWO_SOURCES.replace("topics:", "use_stamped: true\n    topics:")


def test_commands_of_the_source_that_wins_go_out_byte_for_byte(bench, tmp_path):
    mux = OwnMux(bench, tmp_path)
    mux.send(NAV, SLOW)
    mux.send(JOY, FAST)
    mux.send(NAV, SLOW)
    mux.send(JOY, SLOW)
    bench.until(lambda: len(mux.out) == 3, "three commands")
    assert mux.bytes == [encode_twist(SLOW), encode_twist(FAST), encode_twist(SLOW)]


def test_stamped_commands_go_out_with_their_header_byte_for_byte(bench, tmp_path):
    mux = OwnMux(bench, tmp_path, STAMPED, stamped=True)
    command = StampedTwist(1_500_000_007, "base_link", SLOW)
    mux.send(NAV, command)
    bench.until(lambda: mux.out, "the command")
    assert mux.bytes == [encode_stamped_twist(command)]


@pytest.mark.parametrize("head", ["/NAMESPACE/twist_mux:", "/**/twist_mux:", "/**:"])
def test_a_file_is_for_the_node_or_for_any(bench, tmp_path, head):
    head = head.replace("/NAMESPACE", bench.namespace)
    mux = OwnMux(bench, tmp_path, TWO_SOURCES.replace("/**/twist_mux:", head))
    mux.send(NAV, SLOW)
    bench.until(lambda: mux.out == [SLOW], "the command")


def test_a_lock_stops_those_below_it_and_lets_those_above_it_drive(bench, tmp_path):
    mux = OwnMux(bench, tmp_path)
    mux.lock(PAUSE, True)
    mux.send(NAV, SLOW)
    mux.send(JOY, FAST)
    mux.lock(PAUSE, False)
    bench.until(lambda: mux.out == [FAST], "the command above the lock")


def test_a_source_that_falls_silent_makes_way_after_its_timeout(bench, tmp_path):
    mux = OwnMux(bench, tmp_path)
    mux.send(JOY, FAST)
    began_s = monotonic()
    while SLOW not in mux.out:
        mux.send(NAV, SLOW)
    assert monotonic() - began_s > 0.4, "not before"
    assert mux.out[0] == FAST


def with_stamped(text: str, source: str, stamped: str) -> str:
    """The file with `stamped` of one source."""
    return text.replace(f"{source}:", f"{source}:\n        stamped: {stamped}")


def test_a_source_may_be_stamped_where_the_output_is_not(bench, tmp_path):
    mux = OwnMux(bench, tmp_path, with_stamped(TWO_SOURCES, "joystick", "true"))
    mux.send(NAV, SLOW)
    mux.send(JOY, StampedTwist(5, "base_link", FAST))
    bench.until(lambda: mux.out == [SLOW, FAST], "both as Twist")


def test_a_source_may_be_unstamped_where_the_output_is_stamped_and_gets_the_time_of_its_reception(bench, tmp_path):
    mux = OwnMux(bench, tmp_path, with_stamped(STAMPED, "joystick", "false"), stamped=True)
    mux.send(NAV, StampedTwist(5, "base_link", SLOW))
    before_ns = mux.node.get_clock().now().nanoseconds
    mux.send(JOY, FAST)
    bench.until(lambda: len(mux.out) == 2, "both as TwistStamped")
    assert mux.out[0] == StampedTwist(5, "base_link", SLOW)
    assert mux.out[1][1:] == ("base_link", FAST), "the frame is that of the last command that had one"
    assert before_ns <= mux.out[1].stamp_ns <= mux.node.get_clock().now().nanoseconds


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_not_finite_is_dropped_counted_and_no_sign_of_life(bench, tmp_path, bad):
    mux = OwnMux(bench, tmp_path)
    mux.send(JOY, Twist(angular_z_rad_s=bad))
    mux.send(NAV, SLOW)
    bench.until(lambda: mux.out == [SLOW], "the sound command alone")
    bench.until_said(f"dropped a message on {bench.namespace}/joy_vel: a velocity is not finite (1 dropped so far)")
    bench.until(lambda: diagnostics(mux, "dropped topics.joystick") == "1", "the count in the diagnostics")


# Who drives


def test_the_driving_source_is_published_for_late_subscribers_too_and_logged(bench, tmp_path):
    mux = OwnMux(bench, tmp_path)
    assert mux.drivers == [""]
    mux.send(NAV, SLOW)
    bench.until(lambda: mux.drivers == ["", "navigation"], "the first driver")
    bench.until_said("navigation drives")
    mux.send(JOY, FAST)
    late = Sources(bench)
    bench.until(lambda: late.drivers[:1] == ["joystick"], "the state for a late subscriber")
    bench.until(lambda: mux.drivers == ["", "navigation", "joystick", ""], "that nobody drives any more")
    bench.until_said("nobody drives")


HEARD = {}


def diagnostics(mux, key):
    """The last value of a key in the diagnostics of a mux; None before there is one."""
    if mux.partner not in HEARD:
        HEARD[mux.partner] = []
        mux.partner.create_subscription(DiagnosticArray, DIAGNOSTICS, HEARD[mux.partner].append, POSE_QOS)
    own = [
        status
        for message in HEARD[mux.partner]
        for status in message.status
        if status.name == "twist_mux: Twist mux status"
        and any("nav_vel" in pair.value for pair in status.values)
        and any(mux.bench.namespace in pair.value for pair in status.values)
    ]
    if not own:
        return None
    values = {pair.key: pair.value for pair in own[-1].values}
    return values.get(key, "") if key else (own[-1].message, own[-1].hardware_id, values)


def test_diagnostics_have_the_names_of_twist_mux(bench, tmp_path):
    mux = OwnMux(bench, tmp_path)
    mux.lock(PAUSE, True)

    def driven():
        mux.send(JOY, FAST)
        return diagnostics(mux, "driver") == "joystick"

    bench.until(driven, "the state in the diagnostics")
    message, hardware, values = diagnostics(mux, "")
    topic = f"{bench.namespace}/"
    assert (message, hardware) == ("ok: joystick drives", "none")
    assert values["velocity topics.joystick"] == f"unmasked, drives, topic {topic}joy_vel, timeout 0.5 s, priority 100"
    assert values["velocity topics.navigation"] == (
        f"masked, expired, locked, topic {topic}nav_vel, timeout 0.5 s, priority 10"
    )
    assert values["lock locks.pause"] == f"locked, topic {topic}pause_navigation, timeout none, priority 50"
    assert values["current priority"] == "50"
    assert 0.0 <= float(values["data age in [sec]"]) <= 0.5


def test_a_publisher_of_the_other_type_is_named(bench, other_bench, tmp_path):
    OwnMux(bench, tmp_path)
    stranger = other_bench.add(Partner)
    stranger.create_publisher(MESSAGES[StampedTwist], NAV, POSE_QOS)
    bench.until_said("publishes geometry_msgs/msg/TwistStamped, expected geometry_msgs/msg/Twist")


# Zero when a lock stops the robot


@pytest.mark.parametrize(("how", "zeros"), [("never", 0), ("once", 1)])
def test_a_lock_that_stops_the_driver_makes_the_mux_publish_a_zero_if_requested(bench, tmp_path, how, zeros):
    mux = OwnMux(bench, tmp_path, TWO_SOURCES, "-p", f"zero_when_locked:={how}")
    mux.send(NAV, SLOW)
    for _ in range(3):
        mux.lock(PAUSE, True)
    mux.send(NAV, SLOW)
    mux.send(JOY, FAST)
    expected = [SLOW, *[Twist()] * zeros, FAST]
    bench.until(lambda: mux.out == expected, "the output")


def test_zeros_are_repeated_until_the_lock_is_off(bench, tmp_path):
    mux = OwnMux(bench, tmp_path, STAMPED, "-p", "zero_when_locked:=repeat", "-p", "zero_period_s:=0.05", stamped=True)
    mux.send(NAV, StampedTwist(5, "base_link", SLOW))
    mux.lock(PAUSE, True)
    bench.until(lambda: len(mux.out) >= 4, "three zeros")
    assert {(command.frame, command.twist) for command in mux.out[1:]} == {("base_link", Twist())}
    mux.lock(PAUSE, False)
    heard = len(mux.out)
    bench.until(
        lambda: (diagnostics(mux, "lock locks.pause") or "").startswith("free"), "diagnostics, many periods later"
    )
    assert len(mux.out) <= heard + 1


# Time


def in_simulated_time(bench, tmp_path):
    """A mux, and what publishes its time."""
    mux = OwnMux(bench, tmp_path, TWO_SOURCES, "-p", "use_sim_time:=true")
    clock = mux.partner.create_publisher(Clock, CLOCK, POSE_QOS)
    bench.until(lambda: clock.get_subscription_count() > 1, "the mux to hear the clock, and when it came")

    def publish_time(now_ns):
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(now_ns, 10**9)
        clock.publish(message)

    return mux, publish_time


def test_ages_are_counted_in_simulated_time(bench, tmp_path):
    mux, publish_time = in_simulated_time(bench, tmp_path)

    def set_time(now_ns):
        publish_time(now_ns)
        bench.until(lambda: mux.node.get_clock().now().nanoseconds == now_ns, "the time")

    set_time(10**9)
    mux.send(JOY, FAST)
    set_time(15 * 10**8)
    mux.send(NAV, SLOW)
    set_time(15 * 10**8 + 1)
    mux.send(NAV, SLOW)
    bench.until(lambda: mux.out == [FAST, SLOW], "the second command of the navigation alone")
    set_time(9 * 10**8)
    mux.send(NAV, SLOW)
    bench.until(lambda: mux.out == [FAST, SLOW, SLOW], "that a clock set back does not revive the joystick")


def test_a_command_that_waited_longer_than_its_timeout_while_the_mux_was_busy_is_not_passed_on(bench, tmp_path):
    mux = OwnMux(bench, tmp_path, TWO_SOURCES.replace("timeout : 0.5\n        priority: 100", "timeout : 0.001\n        priority: 100"))  # fmt: skip
    for topic, command in ((JOY, FAST), (NAV, SLOW)):
        mux.publisher(topic, Twist).publish(encode_twist(command))
    busy_s = monotonic() + 0.002
    while monotonic() < busy_s:
        pass
    bench.until(lambda: mux.out, "a command")
    mux.send(NAV, FAST)
    bench.until(lambda: mux.out == [SLOW, FAST], "those of the source that waits long enough, and no other")


def test_nor_is_one_in_simulated_time(bench, tmp_path):
    mux, publish_time = in_simulated_time(bench, tmp_path)
    mux.publisher(NAV, Twist)
    joystick = mux.publisher(JOY, Twist)
    publish_time(2 * 10**9)
    joystick.publish(encode_twist(FAST))
    publish_time(9 * 10**9)
    bench.until(lambda: mux.received(), "the command to be read")
    mux.send(NAV, SLOW)
    bench.until(lambda: mux.out == [SLOW], "the command of now alone")


# Bad input


def entry(kind="topics", name="a", topic="a_vel", timeout="0.5", priority="10", more=""):
    """One entry of a file."""
    fields = {"topic": topic, "timeout": timeout, "priority": priority}
    lines = [f"        {key}: {value}" for key, value in fields.items() if value is not None]
    return "\n".join([f"    {kind}:", f"      {name}:", *lines, f"        {more}" if more else ""])


GOOD = entry()


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (entry(timeout=None), "parameter 'topics.a.timeout' is missing"),
        (entry(priority=None), "parameter 'topics.a.priority' is missing"),
        (entry(topic=None), "parameter 'topics.a.topic' is missing"),
        (entry(timeout="1"), "parameter 'topics.a.timeout' must be double, not integer 1; write 1.0"),
        (entry(timeout=".inf"), "parameter 'topics.a.timeout' is inf, outside of"),
        (entry(priority="10.0"), "parameter 'topics.a.priority' must be integer, not double 10.0"),
        (entry(topic="5"), "parameter 'topics.a.topic' must be string, not integer 5"),
        (entry(topic="'a vel'"), "parameter 'topics.a.topic': Invalid topic name"),
        (entry(topic="''"), "parameter 'topics.a.topic': Invalid topic name"),
        (entry(more="prority: 3"), "unknown parameter 'topics.a.prority'; known are: use_stamped"),
        (entry(more="stamped: 1"), "parameter 'topics.a.stamped' must be bool, not integer 1"),
        (GOOD + "      b: {topic: a_vel, timeout: 0.5, priority: 9}", "topics.a and topics.b are both .*/a_vel"),
        (entry(topic="cmd_vel_out"), "topics.a is .*/cmd_vel_out, on which the mux publishes"),
        (GOOD + entry("locks", "l", priority=None), "parameter 'locks.l.priority' is missing"),
        (GOOD + entry("locks", "l", more="stamped: true"), "unknown parameter 'locks.l.stamped'"),
        ("    use_stamped: false", "there is no source of commands; give each as topics.NAME"),
        (GOOD + "    use_stamped: 1", "parameter 'use_stamped' must be bool"),
        (GOOD + "    zero_when_locked: always", ".*choose one of: never, once, repeat"),
        (GOOD + "    lern: true", "unknown parameter 'lern'"),
    ],
)
def test_an_error_in_a_file_is_one_line_that_names_the_node(bench, tmp_path, body, reason):
    file = tmp_path / "twist_mux.yaml"
    file.write_text(f"/**/twist_mux:\n  ros__parameters:\n{body}\n")
    with pytest.raises(BadInput, match=f"^{bench.namespace}/twist_mux: {reason}") as refusal:
        bench.add(lambda **options: TwistMuxNode(cli_args=["--ros-args", "--params-file", str(file)], **options))
    assert "\n" not in str(refusal.value)


def test_priorities_out_of_range_and_0_are_warned_of(bench, tmp_path):
    OwnMux(
        bench, tmp_path, TWO_SOURCES.replace("priority: 100", "priority: 300").replace("priority: 10", "priority: 0")
    )
    bench.until_said("joystick: priority 300 is clamped to 0 to 255")
    bench.until_said("navigation: a source of priority 0 never drives")


def test_its_parameters_are_listed_with_their_values_and_frozen(bench, tmp_path):
    node = OwnMux(bench, tmp_path, with_stamped(TWO_SOURCES, "joystick", "true")).node
    assert node.get_parameter("topics.joystick.stamped").value is True
    assert node.get_parameter("topics.navigation.stamped").value is False
    assert node.get_parameter("topics.navigation.priority").value == 10
    assert not node.set_parameters([Parameter("topics.navigation.priority", value=11)])[0].successful
