"""`replay.py RUN --set ... --trees ...`: what would have been decided, compared with what was, on the recorded world states."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from commands import replay as main
from fbql_behaviors.core.tree import Leaf, Tree
from fbql_behaviors.storage import load_tree, save_tree
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_recording.run import open_run
from recorded_match import TREES, record_match

BEHAVIORS = ("ball_seeking", "wall_avoiding", "approaching")
LEARNING = {"controller": "fbql_literal", "guided": 1, "tie_rule": "first"}


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that learned. Not to be changed."""
    return record_match(tmp_path_factory.mktemp("learned") / "run", max_steps=300, **LEARNING)


@pytest.fixture(scope="module")
def layered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of Subsumption. Not to be changed."""
    return record_match(tmp_path_factory.mktemp("layered") / "run", max_steps=300)


def what_if(run: Path, capsys: pytest.CaptureFixture[str], *options: str, code: int = 0) -> dict[str, Any]:
    assert main([str(run), "--json", *options]) == code
    return json.loads(capsys.readouterr().out)


def test_nothing_changed_is_nothing_different(learned, capsys):
    found = what_if(learned, capsys, "--set", "tie_rule=first")
    assert (found["changed"], found["steps_that_differ"], found["first_difference"]) == ({}, 0, None)
    assert found["steps"] == sum(1 for _ in open_run(learned).steps())
    assert main([str(learned), "--set", "tie_rule=first"]) == 0
    assert f"the same in all {found['steps']} steps" in capsys.readouterr().out


def test_another_parameter_decides_as_a_session_with_that_parameter_does(learned, capsys, tmp_path):
    """The same by hand: a session with the other gain, led through the recorded steps."""
    table = tmp_path / "steps.csv"
    found = what_if(learned, capsys, "--set", "weight_gain=0.05", "--csv", str(table))
    assert found["changed"] == {"weight_gain": [0.01, 0.05]}
    session = SoccerSession(FusionParameters(episodes=2, seed=3, weight_gain=0.05, **LEARNING))
    differing, commands = 0, []
    with table.open(newline="") as file:
        for row, step in zip(csv.DictReader(file), open_run(learned).steps(), strict=True):
            if step.step == 0:
                session.next_episode()
            command, decision = session.decide(step.world, step.outputs)
            assert [float(row[f"what_if.weight.{name}"]) for name in BEHAVIORS] == list(decision.weights)
            assert [float(row[f"what_if.q.{name}"]) for name in BEHAVIORS] == list(decision.q)
            assert float(row["what_if.command_left_rad_s"]) == command.left_rad_s
            assert [float(row[f"recorded.weight.{name}"]) for name in BEHAVIORS] == list(step.decision.weights)
            differing += decision.weights != step.decision.weights
            commands.append(
                max(
                    abs(command.left_rad_s - step.command.left_rad_s),
                    abs(command.right_rad_s - step.command.right_rad_s),
                )
            )
    assert found["weights"]["steps"] == differing > 0
    assert found["commands"]["steps"] == sum(command > 0 for command in commands)
    assert found["commands"]["max_rad_s"] == max(commands)
    assert found["commands"]["mean_rad_s"] == pytest.approx(sum(commands) / len(commands))


def test_guided_episodes_stay_the_guides(learned, capsys):
    found = what_if(learned, capsys, "--set", "weight_gain=0.05")
    assert found["first_difference"]["episode"] > 0
    assert found["episodes"][0]["steps_that_differ"] == 0


def test_a_threshold_that_is_always_met_lets_that_layer_drive(layered, capsys, tmp_path):
    table = tmp_path / "steps.csv"
    what_if(layered, capsys, "--set", "wall_threshold_m=10", "--csv", str(table))
    last = {(e.index, e.steps) for e in open_run(layered).episodes()}
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["what_if.driver"] for row in rows} == {"1"}
    for row in rows:
        if (int(row["episode"]), int(row["step"])) not in last:
            assert row["what_if.command_left_rad_s"] == row["recorded.reference_left_rad_s.wall_avoiding"]


def test_a_preset_takes_the_place_of_thresholds_that_were_given(tmp_path, capsys):
    run = record_match(tmp_path / "run", wall_threshold_m=0.3, approach_threshold_rad=1.0)
    found = what_if(run, capsys, "--preset", "tuned")
    assert found["changed"] == {"wall_threshold_m": [0.3, -1.0], "approach_threshold_rad": [1.0, -1.0]}
    assert found["steps_that_differ"] > 0


def test_another_controller_is_told_by_weights_and_drivers(layered, capsys):
    found = what_if(layered, capsys, "--controller", "uniform", "--set", "guided=0")
    assert found["weights"]["steps"] == found["drivers"] == found["steps"]
    # From one behavior alone to a third each, two thirds go to others.
    assert found["weights"]["max"] == pytest.approx(2 / 3)
    assert found["weights"]["mean"] == pytest.approx(2 / 3)
    assert set(found["answers"].values()) == {0}


def test_another_tree_changes_the_answers_of_its_behavior_alone(layered, capsys, tmp_path):
    """One leaf for everything: it differs wherever the recorded reference is another."""
    trees = tmp_path / "trees"
    trees.mkdir()
    shipped = load_tree(TREES / "wall_avoiding.json")
    save_tree(trees / "wall_avoiding.json", Tree(shipped.behavior, shipped.features, (0,), (Leaf(1.0, 2.0, 1),), {}))
    found = what_if(layered, capsys, "--trees", str(trees))
    steps = list(open_run(layered).steps())
    answers = [step.outputs[1] for step in steps]
    differing = sum((a.leaf_id, a.left_rad_s, a.right_rad_s) != (0, 1.0, 2.0) for a in answers)
    assert found["answers"] == {"ball_seeking": 0, "wall_avoiding": differing, "approaching": 0}
    assert differing > 0
    driven = sum(step.decision.driver == 1 and not step.world.ended for step in steps)
    assert found["commands"]["steps"] <= driven
    assert found["trees"].keys() == {"wall_avoiding"}


def test_the_same_trees_change_nothing(layered, capsys):
    assert what_if(layered, capsys, "--trees", str(TREES))["steps_that_differ"] == 0


def test_an_answer_that_was_missing_is_missing_with_other_trees_too(tmp_path, capsys):
    def hear(world, outputs):
        return [None if world.step == 5 and i == 0 else output for i, output in enumerate(outputs)]

    run = record_match(tmp_path / "run", hear=hear)
    assert what_if(run, capsys, "--trees", str(TREES))["steps_that_differ"] == 0


def test_a_policy_is_left_out_where_it_is_another_controllers(learned, tmp_path, capsys):
    run = record_match(tmp_path / "run", policy=learned / "policy.npz", **(LEARNING | {"guided": -1}))
    assert what_if(run, capsys, "--set", "tie_rule=first")["steps_that_differ"] == 0
    assert what_if(run, capsys, "--policy", "none", "--set", "guided=0")["steps_that_differ"] > 0
    assert what_if(run, capsys, "--policy", str(learned / "policy.npz"))["steps_that_differ"] == 0
    notes = what_if(run, capsys, "--controller", "uniform")["notes"]
    assert notes == ["the run's policy belongs to another controller and is not used"]


def test_a_parameter_of_another_controller_plays_no_part_and_that_is_said(layered, learned, capsys):
    found = what_if(layered, capsys, "--set", "weight_gain=0.05", "--set", "fbql_rate=0.2")
    assert found["steps_that_differ"] == 0
    assert sorted(found["notes"]) == [
        "fbql_rate has no effect: it belongs to fbql and fbql_model, and the controller is subsumption",
        "weight_gain has no effect: it belongs to fbql_literal, and the controller is subsumption",
    ]
    others = {
        "fbql_mirror=false": "fbql, fbql_model and fbql_value",
        "fbql_value_trace=0.5": "fbql_value",
        "fbql_value_rate=0.5": "fbql and fbql_model",
    }
    for change, owner in others.items():
        assert what_if(layered, capsys, "--set", change)["notes"] == [
            f"{change.split('=')[0]} has no effect: it belongs to {owner}, and the controller is subsumption"
        ]
    assert main([str(layered), "--set", "weight_gain=0.05"]) == 0
    assert capsys.readouterr().out.endswith(f"{sorted(found['notes'])[-1]}\n")
    assert what_if(layered, capsys, "--preset", "paper")["notes"] == []
    # Subsumption guides the run that learned.
    assert what_if(learned, capsys, "--preset", "paper")["notes"] == []
    unguided = what_if(learned, capsys, "--preset", "paper", "--set", "guided=0")
    assert unguided["notes"] == [
        "preset has no effect: it belongs to subsumption, the controller is fbql_literal, and no episode is guided"
    ]


def test_the_figure_is_an_svg_with_a_curve_of_each_and_the_same_every_time(learned, capsys, tmp_path):
    pytest.importorskip("matplotlib")
    figures = [tmp_path / "one.svg", tmp_path / "two.svg"]
    for figure in figures:
        what_if(learned, capsys, "--set", "weight_gain=0.05", "--figure", str(figure))
    root = ElementTree.parse(figures[0]).getroot()
    texts = {element.text for element in root.iter("{http://www.w3.org/2000/svg}text")}
    assert {*BEHAVIORS, "weight of", "recorded", "what if", "episode 0"} <= texts
    curves = {element.get("id") for element in root.iter()}
    assert {"commands", *(f"{which}_{index}" for which in ("recorded", "what_if") for index in range(3))} <= curves
    assert figures[0].read_bytes() == figures[1].read_bytes()


def test_the_words_tell_where_and_by_how_much(layered, capsys):
    found = what_if(layered, capsys, "--preset", "paper")
    assert main([str(layered), "--preset", "paper"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("what if: preset=paper\n")
    first = found["first_difference"]
    assert f"differs in {found['steps_that_differ']} of {found['steps']} steps" in said
    assert f"first at episode {first['episode']}, step {first['step']} " in said
    assert f"{found['commands']['max_rad_s']:.3g} rad/s at most" in said


def test_a_run_that_was_killed_is_computed_as_far_as_it_goes(tmp_path, capsys):
    run = record_match(tmp_path / "run", close=False)
    found = what_if(run, capsys, "--set", "wall_threshold_m=0.5", code=3)
    assert found["steps"] > 60


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--set", "weight_gian=1"], "write NAME=VALUE with a parameter of fusion"),
        (["--set", "episodes=1"], "the world states stay as they were recorded"),
        (["--set", "ball_mass_kg=1"], "the world states stay as they were recorded"),
        (["--set", "weight_gain=x"], "'x' is not a number"),
        (["--set", "discount=2"], "--set discount is 2.0, outside of [0, 1]"),
        (["--trees", "/nowhere"], "none of ball_seeking.json, wall_avoiding.json, approaching.json is there"),
        (["--policy", "/nowhere/policy.npz"], "/nowhere/policy.npz"),
        (["--preset", "paper", "--csv", "/nowhere/x.csv"], "/nowhere/x.csv: cannot be written"),
    ],
)
def test_what_cannot_be_is_one_line(layered, capsys, options, says):
    assert main([str(layered), *options]) == 2
    said = capsys.readouterr().err
    assert says in said
    assert said.count("\n") == 1
