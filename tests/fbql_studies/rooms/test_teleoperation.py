"""The operator gets to the goal by three keys, and the tree that was induced from it is a source like the others."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
import yaml
from fbql_behaviors.storage import load_tree
from fbql_studies.rooms.maps import Room, room_of
from fbql_studies.rooms.play import drive, end_of
from fbql_studies.rooms.robot import BEAMS, RANGE_M, SPACE
from fbql_studies.rooms.sources import sectors
from fbql_studies.rooms.teleoperation import FORWARD_M_S, TURN_RAD_S, Operator
from fbql_studies.rooms.tree_source import SHIPPED, TREE, sources_with_tree
from fbql_studies.rooms.worlds import TwinWorld
from places import ROOT

SPEC = ROOT / "examples" / "rooms" / "behavior.yaml"


@pytest.mark.parametrize(("family", "least"), [("traps", 11), ("doors", 8)])
def test_the_operator_gets_to_the_goal(family: str, least: int) -> None:
    reached = 0
    for seed in range(700_000, 700_012):
        room, world = room_of(family, seed), TwinWorld()
        operator, reading = Operator(room), world.reset(room)
        while not (reading.terminated or reading.truncated):
            v, w = operator.keys(reading)
            assert v in (0.0, FORWARD_M_S)
            assert w in (-TURN_RAD_S, 0.0, TURN_RAD_S)
            reading = world.step(v, w)
        reached += end_of(room, reading).outcome == "success"
    assert reached >= least


def test_beside_the_way_the_operator_finds_back_to_it() -> None:
    """Nearer to a wall than it would drive."""
    room = Room("traps", 0, room_of("traps", 0).obstacles[:4], (0.28, 5.0, pi / 2), (8.0, 5.0))
    operator = Operator(room)
    (end,) = drive(TwinWorld(), [room], operator.keys, lambda: None)
    assert end.outcome == "success"


def test_the_tree_is_a_source_whose_commands_the_robot_takes() -> None:
    source = sources_with_tree()[TREE]
    tree = load_tree(SHIPPED)
    generator = np.random.default_rng(1)
    commands = set()
    for _ in range(300):
        ranges = generator.uniform(0.2, RANGE_M, BEAMS) * generator.choice([0.3, 1.0])
        bearing = float(generator.uniform(-pi, pi))
        command = source(ranges, 5.0, bearing)
        assert command == SPACE.limited(command) == tree.answer((bearing, *sectors(ranges)))[1:]
        commands.add(command)
    assert len(commands) > 3


def test_the_tree_was_made_with_the_spec_of_the_example() -> None:
    spec, tree = yaml.safe_load(SPEC.read_text()), load_tree(SHIPPED)
    assert [feature.name for feature in tree.features] == list(spec["observations"])
    assert [each.name for each in tree.commands.axes] == list(spec["command"]["axes"])
    assert tree.recipe
    fields = [each["field"] for each in spec["observations"].values()][1:]
    assert fields == [
        f"ranges[{first}:{last}].min" for first, last in ((14, 24), (24, 32), (32, 41), (41, 49), (49, 59))
    ]
