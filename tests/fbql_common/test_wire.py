"""Every message of ours: domain type -> bytes -> the middleware's own message and back, no field at its default."""

import math

import pytest
from fbql_common import wire
from fbql_common.core.mux_types import MuxDecision, RobotOutcome
from fbql_common.core.twist import StampedTwist, Twist
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

FINITE = st.floats(-1e6, 1e6)
STEPS = st.integers(0, 2**40)
STAMPS = st.integers(0, 2**31 * 10**9 - 1)
NAMES = st.text(st.characters(min_codepoint=1, max_codepoint=0x2FF), max_size=12)
WORLDS = st.builds(World, STAMPS, st.integers(-1, 2**40), STEPS, *[FINITE] * 12, *[st.booleans()] * 6)
OUTPUTS = st.tuples(st.integers(1, 900), st.integers(0, 10**6)).flatmap(
    lambda leaves: st.builds(
        BehaviorOutput,
        STAMPS,
        STEPS,
        STEPS,
        NAMES,
        FINITE,
        FINITE,
        st.just(leaves[1] % leaves[0]),
        st.just(leaves[0]),
        NAMES,
        st.booleans(),
        st.lists(FINITE, max_size=4).map(tuple),
    )
)
COMMANDS = st.builds(WheelCommand, STAMPS, STEPS, STEPS, FINITE, FINITE)
DECISIONS = st.builds(
    Decision,
    STAMPS,
    STEPS,
    STEPS,
    NAMES,
    st.integers(0, 2),
    st.lists(NAMES, max_size=4).map(tuple),
    st.lists(st.integers(-1, 900), max_size=4).map(tuple),
    st.lists(FINITE, max_size=4).map(tuple),
    st.lists(FINITE, max_size=4).map(tuple),
    st.integers(-1, 3),
    FINITE,
    st.booleans(),
    st.lists(FINITE, max_size=4).map(tuple),
)
FLOATS = st.lists(FINITE, max_size=4).map(tuple)
MUX_DECISIONS = DECISIONS.flatmap(
    lambda decision: st.builds(
        MuxDecision,
        *map(st.just, decision),
        st.booleans(),
        st.booleans(),
        NAMES,
        FLOATS,
        st.lists(st.booleans(), max_size=4).map(tuple),
        FLOATS,
        FLOATS,
        NAMES,
        FLOATS,
    )
)
OUTCOMES = st.builds(RobotOutcome, STAMPS, FINITE, st.booleans(), st.booleans(), NAMES)
TWISTS = st.builds(Twist, *[FINITE] * 6)
PAIRS = [
    (WORLDS, wire.encode_world, wire.decode_world),
    (OUTPUTS, wire.encode_output, wire.decode_output),
    (COMMANDS, wire.encode_command, wire.decode_command),
    (DECISIONS, wire.encode_decision, wire.decode_decision),
    (TWISTS, wire.encode_twist, wire.decode_twist),
    (st.builds(StampedTwist, STAMPS, NAMES, TWISTS), wire.encode_stamped_twist, wire.decode_stamped_twist),
    (st.booleans(), wire.encode_flag, wire.decode_flag),
    (FINITE, wire.encode_number, wire.decode_number),
    (OUTCOMES, wire.encode_outcome, wire.decode_outcome),
    (MUX_DECISIONS, wire.encode_mux_decision, wire.decode_mux_decision),
]

WORLD = World(1_234_567_890, 3, 17, -1.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, *[True, False] * 3)
OUTPUT = BehaviorOutput(5, 1, 2, "ball_seeking", 1.0, 2.0, 3, 110, "ab" * 32, True, (0.5, 0.25))
COMMAND = WheelCommand(5, 1, 2, 1.5, -2.5)
DECISION = Decision(5, 1, 2, "fbql", 1, ("a", "b"), (1, 2), (0.1, 0.2), (0.3, 0.7), 1, -5.0, True, (0.4, 0.6))
MUX_DECISION = MuxDecision(
    *DECISION, True, False, "success", (1.0, 2.0), (True, False), (0.1, 0.2, 0.3, 0.4), (0.5, -1.0), "joy", (0.7, 0.8)
)
TWIST = Twist(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


@pytest.mark.parametrize(("values", "encode", "decode"), PAIRS)
def test_we_read_our_own_bytes_and_the_middleware_reads_them_and_we_read_its(values, encode, decode):
    @given(values)
    def check(value):
        data = encode(value)
        assert decode(data) == value
        message = deserialize_message(data, wire.MESSAGES[type(value)])
        assert decode(serialize_message(message)) == value

    check()


ENCODE = {
    World: wire.encode_world,
    BehaviorOutput: wire.encode_output,
    WheelCommand: wire.encode_command,
    Decision: wire.encode_decision,
    MuxDecision: wire.encode_mux_decision,
}


@pytest.mark.parametrize("value", [WORLD, OUTPUT, COMMAND, DECISION, MUX_DECISION])
def test_fields_arrive_under_their_own_names(value):
    data = ENCODE[type(value)](value)
    message = deserialize_message(data, wire.MESSAGES[type(value)])
    stamp = message.header.stamp
    frame = "" if isinstance(value, MuxDecision) else "field"
    assert (stamp.sec * 10**9 + stamp.nanosec, message.header.frame_id) == (value.stamp_ns, frame)
    for name in value._fields[1:]:
        got, expected = getattr(message, name), getattr(value, name)
        assert (tuple(got) if isinstance(expected, tuple) else got) == expected, name


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_not_finite_is_rejected(bad):
    for field in World._fields[3:15]:
        with pytest.raises(wire.Rejected, match="not finite"):
            wire.decode_world(wire.encode_world(WORLD._replace(**{field: bad})))
    for data, decode in (
        (wire.encode_number(bad), wire.decode_number),
        (wire.encode_outcome(RobotOutcome(0, bad)), wire.decode_outcome),
    ):
        with pytest.raises(wire.Rejected, match="not finite"):
            decode(data)
    for field in ("left_rad_s", "right_rad_s"):
        with pytest.raises(wire.Rejected, match="not finite"):
            wire.decode_output(wire.encode_output(OUTPUT._replace(**{field: bad})))
        with pytest.raises(wire.Rejected, match="not finite"):
            wire.decode_command(wire.encode_command(COMMAND._replace(**{field: bad})))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", Twist._fields)
def test_a_twist_with_a_velocity_that_is_not_finite_is_rejected(field, bad):
    twist = TWIST._replace(**{field: bad})
    with pytest.raises(wire.Rejected, match="a velocity is not finite"):
        wire.decode_twist(wire.encode_twist(twist))
    with pytest.raises(wire.Rejected, match="a velocity is not finite"):
        wire.decode_stamped_twist(wire.encode_stamped_twist(StampedTwist(5, "base_link", twist)))


def test_velocities_of_a_twist_arrive_under_their_own_names():
    message = deserialize_message(wire.encode_twist(TWIST), wire.MESSAGES[Twist])
    assert (message.linear.x, message.linear.y, message.linear.z) == TWIST[:3]
    assert (message.angular.x, message.angular.y, message.angular.z) == TWIST[3:]
    stamped = StampedTwist(1_234_567_890, "base_link", TWIST)
    message = deserialize_message(wire.encode_stamped_twist(stamped), wire.MESSAGES[StampedTwist])
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1, 234_567_890)
    assert (message.header.frame_id, message.twist.linear.x, message.twist.angular.z) == (
        "base_link",
        TWIST[0],
        TWIST[5],
    )


@pytest.mark.parametrize("leaf_id", [-1, 110, 10**6])
def test_leaf_id_out_of_range_is_rejected(leaf_id):
    with pytest.raises(wire.Rejected, match="leaf_id"):
        wire.decode_output(wire.encode_output(OUTPUT._replace(leaf_id=leaf_id)))


def test_wrong_frame_is_rejected_naming_the_expected_one():
    message = deserialize_message(wire.encode_world(WORLD), wire.MESSAGES[World])
    message.header.frame_id = "map"
    with pytest.raises(wire.Rejected, match="'map', expected 'field'"):
        wire.decode_world(serialize_message(message))


@pytest.mark.parametrize(("sec", "nanosec"), [(-1, 0), (0, 10**9), (5, 2**32 - 1)])
def test_stamp_that_is_not_a_time_is_rejected(sec, nanosec):
    message = deserialize_message(wire.encode_world(WORLD), wire.MESSAGES[World])
    message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec
    with pytest.raises(wire.Rejected, match="not a valid time"):
        wire.decode_world(serialize_message(message))


def test_bytes_of_another_message_are_rejected():
    with pytest.raises(wire.Rejected, match="malformed"):
        wire.decode_world(wire.encode_command(COMMAND))


@pytest.mark.parametrize("message", wire.MESSAGES.values(), ids=lambda message: message.__name__)
def test_no_message_that_a_node_receives_has_a_quaternion_that_could_be_wrong(message):
    """Poses come in as x, y and yaw. An input takes no other types, and a pose of geometry_msgs is only ever published."""
    kinds = {kind.removeprefix("sequence<").removesuffix(">") for kind in message.get_fields_and_field_types().values()}
    velocities = {"geometry_msgs/Twist", "geometry_msgs/Vector3"}
    plain = {
        "std_msgs/Header",
        "builtin_interfaces/Time",
        "double",
        "int32",
        "int64",
        "uint8",
        "boolean",
        "string",
        "octet",
    }
    assert kinds <= plain | velocities, kinds
