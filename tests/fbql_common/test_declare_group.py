"""Groups of parameters, PREFIX.NAME.FIELD, whose names are whatever a node is given."""

from dataclasses import dataclass

import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import parameter
from fbql_common.declare import declare_all, declare_group
from hand_driven import Partner
from rclpy.parameter import Parameter


@dataclass(frozen=True)
class Whole:
    """Parameters outside of any group."""

    speed: float = parameter(1.0, "a speed")


@dataclass(frozen=True)
class Part:
    """Parameters of each member of a group."""

    topic: str = parameter("", "a topic", required=True)
    share: float = parameter(0.5, "a share", low=0.0, high=1.0)


@pytest.fixture
def grouped(bench):
    """Declares the group 'parts' of a node with these arguments; gives what was declared."""

    def declare(*arguments, **defaults):
        node = bench.add(lambda **options: Partner(cli_args=["--ros-args", *arguments], **options))
        declare_all(node, Whole, groups={"parts": Part})
        return node, declare_group(node, "parts", Part, **defaults)

    return declare


def test_members_of_a_group_come_in_the_order_of_their_bytes_as_in_a_c_plus_plus_node(grouped, tmp_path):
    file = tmp_path / "parameters.yaml"
    names = ["b", "a.z", "a", "B", "ab", "a-", "é", "a_"]
    lines = [f"    parts.{name}.topic: of_{name}" for name in names]
    file.write_text("\n".join(["/**:", "  ros__parameters:", *lines]))
    _, found = grouped("--params-file", str(file))
    # The dot before the field counts: '-' < '.' < '_' < 'b', and a.topic < a.z.topic.
    assert list(found) == ["B", "a-", "a", "a.z", "a_", "ab", "b", "é"]
    assert found["a.z"] == Part(topic="of_a.z")


def test_parameters_of_a_group_are_declared_with_range_and_frozen(grouped):
    node, found = grouped("-p", "parts.a.topic:=x", "-p", "parts.b.topic:=w", "-p", "parts.b.share:=0.25", share=0.75)
    assert found == {"a": Part("x", 0.75), "b": Part("w", 0.25)}
    assert node.get_parameter("parts.a.share").value == 0.75
    assert not node.set_parameters([Parameter("parts.a.topic", value="z")])[0].successful


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["parts.a.share:=0.5"], "parameter 'parts.a.topic' is missing"),
        (
            ["parts.a.topic:=x", "parts.a.share:=1"],
            "parameter 'parts.a.share' must be double, not integer 1; write 1.0",
        ),
        (["parts.a.topic:=x", "parts.a.share:=1.5"], r"parameter 'parts.a.share' is 1.5, outside of \[0, 1\]"),
        (["parts.a.topic:=x", "parts.a.share:=.nan"], r"parameter 'parts.a.share' is nan, outside of \[0, 1\]"),
        (["parts.a.topic:=5"], "parameter 'parts.a.topic' must be string, not integer 5"),
        (
            ["parts.a.tpoic:=x"],
            "unknown parameter 'parts.a.tpoic'; known are: speed, parts.NAME.topic, parts.NAME.share",
        ),
        (["parts.topic:=x"], "unknown parameter 'parts.topic'"),
        (["part.a.topic:=x"], "unknown parameter 'part.a.topic'"),
    ],
)
def test_an_error_in_a_group_names_the_full_parameter(grouped, arguments, reason):
    with pytest.raises(BadInput, match=f"partner: {reason}"):
        grouped(*(word for argument in arguments for word in ("-p", argument)))
