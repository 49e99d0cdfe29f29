"""A behavior of the user's own, from its twenty lines to a match of four: the example, in one process."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import replace
from math import radians
from pathlib import Path

import pytest
from commands import demonstrate
from commands import induce as induction
from fbql.cli.observations import register_observations
from fbql.demonstrations import instruct as instructing
from fbql.demonstrations.instruct import ANYWHERE, at_rest, instruct
from fbql.match.in_process import play
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.core.induction import induce
from fbql_behaviors.core.observation import OBSERVATIONS, Feature, Law, Observation, observation_of, register
from fbql_behaviors.core.patterns import Demonstration, patterns_of
from fbql_behaviors.core.recipes import recipe_of
from fbql_behaviors.storage import load_tree, tree_to_bytes
from fbql_common.core.errors import BadInput
from fbql_common.core.types import WheelCommand
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.task import Task
from fbql_sim.core.world_loop import WorldLoop
from places import ROOT

EXAMPLE = ROOT / "examples/shooting"
TREES = ROOT / "ros2_ws/src/fbql_behaviors/fbql_behaviors/trees"
NAMES = ("ball_seeking", "wall_avoiding", "approaching", "shooting")
LAYERS = ["shooting", "wall_avoiding", "approaching", "ball_seeking"]


@pytest.fixture(autouse=True)
def shooting() -> Iterator[Observation]:
    """The example's behavior is known in each test, and in no other."""
    before = dict(OBSERVATIONS)
    register_observations([str(EXAMPLE / "shooting.py")])
    yield observation_of("shooting")
    OBSERVATIONS.clear()
    OBSERVATIONS.update(before)


def test_it_takes_no_more_than_twenty_lines() -> None:
    text = (EXAMPLE / "shooting.py").read_text()
    lines = [line for line in text.splitlines() if line.strip()]
    assert len(lines) <= 20


def test_the_page_that_explains_it_shows_it_as_it_is() -> None:
    assert f"```python\n{(EXAMPLE / 'shooting.py').read_text()}```" in (ROOT / "docs/add_a_behavior.md").read_text()


def test_its_tree_is_made_again_from_its_demonstrations(shooting: Observation) -> None:
    recipe = recipe_of("shooting")
    patterns = patterns_of(instruct("shooting", 1, 300, recipe.steps), shooting, recipe.every, recipe.patterns)
    tree = induce("shooting", patterns, replace(recipe.induction, split_cost=-0.03), 1).tree
    assert tree_to_bytes(tree) == (EXAMPLE / "shooting.json").read_bytes()
    readme = (EXAMPLE / "README.md").read_text()
    assert f"{tree.leaf_count} leaves from {len(patterns)} patterns" in readme


@pytest.mark.parametrize(
    ("law", "told"),
    [
        (lambda _: (1.0,), r"fails \(ValueError: not enough values to unpack .*\); it must return left, right"),
        (lambda _: (1.0, float("inf")), r"returns 1.0, inf; wheel velocities must be finite"),
        (lambda observed: (observed[0] / 0.0, 1.0), r"fails \(ZeroDivisionError: .*\)"),
    ],
)
def test_an_instructor_that_cannot_answer_is_one_line(law: Law, told: str, shooting: Observation) -> None:
    OBSERVATIONS["shooting"] = replace(shooting, instructor=law)
    with pytest.raises(
        BadInput, match=rf"the instructor of behavior 'shooting', called with \(.*\), {told}"
    ) as refused:
        instruct("shooting", 1, 1, 5)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("again", [(), ("--merge",), ("--replay",)])
def test_what_is_said_to_come_next_after_demonstrating_works(
    again: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.isatty", lambda _: False)
    place, file = tmp_path / "what was shown", str(EXAMPLE / "shooting.py")
    few = ("--demonstrations", "4", "--steps", "20", "--out", str(place))
    assert demonstrate(["shooting", "--observation", file, *few]) == 0
    if again:
        assert demonstrate(["--observation", file, *again, str(place), "--out", str(tmp_path / "merged")]) == 0
    said = capsys.readouterr().err.splitlines()[-1]
    words = shlex.split(said.removeprefix("Next: python3 scripts/induce.py "))
    del OBSERVATIONS["shooting"]  # as in another process
    assert induction([*words, "--out", str(tmp_path / "shooting.json")]) == 0
    assert load_tree(tmp_path / "shooting.json").behavior == "shooting"


def test_demonstrations_begin_inside_of_the_root_region_and_patterns_lie_there(shooting: Observation) -> None:
    demonstrations = instruct("shooting", 3, 10, 60)
    assert all(shooting.contains(shooting.sense(each.worlds[0])) for each in demonstrations)
    moments = [world for each in demonstrations for world in each.worlds]
    inside = [world for world in moments if shooting.contains(shooting.sense(world))]
    assert 0 < len(inside) < len(moments)
    patterns = patterns_of(demonstrations, shooting)
    assert len(patterns) == len(inside)
    assert abs(patterns.x).max() < radians(20.0)


def test_a_start_is_looked_at_as_the_world_begins_it() -> None:
    loop, task = WorldLoop(ANYWHERE), Task(ANYWHERE)
    for seed in range(200):
        begun = loop.reset(0, seed)
        assert at_rest(task.begin(seed)) == begun._replace(stamp_ns=0)


def test_a_moment_outside_of_the_root_region_is_no_pattern() -> None:
    observation = Observation((Feature("ball_x", "m", 0.0, 0.5),), lambda world: (world.ball_x_m,))
    world = WorldLoop().reset(0, 1)
    worlds = tuple(world._replace(ball_x_m=x) for x in (-0.1, 0.0, 0.4, 0.5))
    commands = tuple(WheelCommand(world.stamp_ns, 0, 0, 50.0, 50.0) for _ in worlds)
    assert patterns_of([Demonstration(worlds, commands)], observation).x.tolist() == [[0.0], [0.4]]


def test_a_root_region_that_no_start_lies_in_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(instructing, "MOST_TRIES", 50)
    register(
        "dreaming", Observation((Feature("ball_x", "m", 5.0, 6.0),), lambda world: (world.ball_x_m,), lambda _: (0, 0))
    )
    with pytest.raises(BadInput, match="behavior 'dreaming': none of 50 starts lies inside its root region"):
        instruct("dreaming", 1, 1, 10)


@pytest.mark.parametrize("controller", ["subsumption", "uniform", "fbql_literal"])
def test_four_behaviors_play_together_and_the_fourth_drives_where_it_knows_what_to_do(controller: str) -> None:
    trees = {name: load_tree(TREES / f"{name}.json") for name in NAMES[:3]} | {
        "shooting": load_tree(EXAMPLE / "shooting.json")
    }
    session = SoccerSession(
        FusionParameters(controller=controller, behaviors=list(NAMES), layers=LAYERS, episodes=3, guided=0, seed=1)
    )
    behaviors = [Behavior(name, trees[name]) for name in NAMES]
    drove: set[tuple[bool, bool]] = set()
    play(
        session,
        WorldLoop(SimulationParameters(max_steps=600)),
        behaviors,
        lambda: True,
        lambda _, outputs, command, decision: drove.add((outputs[3].clamped, decision.driver == 3)),
    )
    assert {clamped for clamped, _ in drove} == {True, False}
    if controller == "subsumption":
        assert drove == {(False, True), (True, False)}
    assert behaviors[3].clamped_count > 0
    assert len(session.records) == 3
