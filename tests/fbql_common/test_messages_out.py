"""Numbers of any Python type go out as their value, and what is no number does not go out at all.

The middleware's own setters take anything: an int in a float64 field would arrive as 4.9e-324.
"""

import numpy as np
import pytest
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_common.wire import MESSAGES, encode_command, encode_decision, encode_output, encode_world
from fbql_sim.views import markers_msg, pose_msg
from hand_driven import output_to, world_at
from rclpy.serialization import deserialize_message, serialize_message

ENCODE = {
    World: encode_world,
    BehaviorOutput: encode_output,
    WheelCommand: encode_command,
    Decision: encode_decision,
}
WORLD = world_at(0, 1)
DECISION = Decision(5, 1, 2, "uniform", 1, ("a",), (1,), (0.5,), (1.0,), -1, 0.0, False)
VALUES = (WORLD, output_to(WORLD, 0), WheelCommand(5, 1, 2, 0.0, 0.0), DECISION)
REALS = [
    (value, field)
    for value in VALUES
    for field, kind in MESSAGES[type(value)].get_fields_and_field_types().items()
    if kind == "double"
]
ONES = [1, True, np.float32(1.0), np.float64(1.0), np.int64(1), np.uint8(1)]
NO_NUMBERS = ["1.0", None, b"1", 1j, (1.0,), np.array([1.0, 2.0])]


def ids(value):
    return type(value).__name__


@pytest.mark.parametrize("one", ONES, ids=ids)
def test_number_of_another_type_arrives_as_its_value(one):
    assert len(REALS) == 17
    for value, field in REALS:
        data = ENCODE[type(value)](value._replace(**{field: one}))
        assert getattr(deserialize_message(data, MESSAGES[type(value)]), field) == 1.0, field


@pytest.mark.parametrize("one", [True, np.int64(1), np.uint8(1)], ids=ids)
def test_integer_of_another_type_arrives_as_its_value(one):
    for value in VALUES:
        data = ENCODE[type(value)](value._replace(step=one))
        assert deserialize_message(data, MESSAGES[type(value)]).step == 1


@pytest.mark.parametrize("bad", NO_NUMBERS, ids=ids)
def test_what_is_no_number_does_not_go_out(bad):
    for value, field in REALS:
        with pytest.raises(TypeError):
            ENCODE[type(value)](value._replace(**{field: bad}))
    for value in VALUES:
        with pytest.raises(TypeError):
            ENCODE[type(value)](value._replace(step=bad))


@pytest.mark.parametrize("bad", [1, None, b"text", 0.5], ids=ids)
def test_what_is_no_text_does_not_go_out(bad):
    with pytest.raises(TypeError):
        encode_output(VALUES[1]._replace(tree_hash=bad))
    with pytest.raises(TypeError):
        encode_decision(DECISION._replace(behaviors=(bad,)))


@pytest.mark.parametrize("one", ONES, ids=ids)
def test_views_are_made_of_floats(one):
    pose = pose_msg(1, one, one, one)
    pose = deserialize_message(serialize_message(pose), type(pose))
    assert (pose.pose.position.x, pose.pose.position.y, pose.header.stamp.nanosec) == (1.0, 1.0, 1)
    world = WORLD._replace(robot_x_m=one, robot_y_m=one, ball_x_m=one)
    markers = markers_msg(world)
    robot = deserialize_message(serialize_message(markers), type(markers)).markers[2]
    assert (robot.ns, robot.pose.position.x, robot.pose.position.y) == ("robot", 1.0, 1.0)
