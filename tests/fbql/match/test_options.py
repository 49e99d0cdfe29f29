"""The options of a match: what it starts from, and which options have no effect."""

from __future__ import annotations

import json
import shlex
import shutil
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from fbql.match.in_process import parts_of
from fbql.match.options import (
    Match,
    controller_options,
    make_run_directory,
    match_from,
    match_parser,
    same_options,
)
from fbql.match.result import next_steps
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree, save_tree
from fbql_common.core.errors import BadInput
from fbql_fusion.shipped import shipped_policy
from own_controller import bandit, only_ours


def match(*words: str) -> Match:
    return match_from(match_parser("play", "").parse_args(words))


def test_copies_of_the_trees_that_ship_are_played_with_the_policy_that_ships(tmp_path: Path) -> None:
    shutil.copytree(shipped_trees(), tmp_path / "trees")
    for words in ((), ("--trees", str(tmp_path / "trees")), ("--no-learn",)):
        found = match(*words)
        assert (found.policy, found.notes) == (shipped_policy(), ())


def test_other_trees_start_untrained_and_it_is_said(tmp_path: Path) -> None:
    trees = shutil.copytree(shipped_trees(), tmp_path / "trees")
    tree = Path(trees) / "approaching.json"
    tree.write_text(json.dumps(json.loads(tree.read_text())))
    assert match("--trees", str(trees)).policy == shipped_policy(), "the same tree, written otherwise"
    shipped = load_tree(tree)
    save_tree(tree, replace(shipped, leaves=(shipped.leaves[1], *shipped.leaves[1:])))
    found = match("--trees", str(trees))
    assert found.policy is None
    assert [note.split(":")[0] for note in found.notes] == ["starts untrained"]
    assert match("--trees", str(trees), "--policy", "none").notes == (), "as it was asked for"
    assert match("--trees", str(trees), "--controller", "subsumption").notes == ()


def test_the_same_options_are_what_was_set_and_not_what_a_run_chooses(tmp_path: Path) -> None:
    assert same_options(match("--seed", "5", "--episodes", "7", "--no-learn")) == ""
    words = ("layers=ball_seeking,wall_avoiding", "fbql_mirror=false", "fbql_rate=0.25", "max_steps=900")
    first = match(*(word for setting in words for word in ("--set", setting)), "--policy", "none")
    again = match(*shlex.split(same_options(first)), "--policy", "none")
    assert (again.fusion, again.simulation) == (first.fusion, first.simulation)
    trees = str(shutil.copytree(shipped_trees(), tmp_path / "my trees"))
    assert shlex.split(same_options(match("--trees", trees))) == ["--trees", trees], "as a shell reads it"


@pytest.mark.parametrize(
    ("words", "notes"),
    [
        (
            ["--set", "reward_collision=-50"],
            ["reward_collision has no effect: the controller is fbql, whose own is fbql_reward_collision"],
        ),
        (["--controller", "subsumption", "--set", "reward_collision=-50"], []),
        (["--controller", "fbql_literal", "--set", "reward_collision=-50"], []),
        (
            ["--set", "discount=0.9", "--set", "fbql_value_trace=0.5", "--set", "tie_rule=first"],
            [
                "discount has no effect: it belongs to fbql_literal, and the controller is fbql (whose own is fbql_discount)",
                "fbql_value_trace has no effect: it belongs to fbql_value, and the controller is fbql (whose own is fbql_trace)",
                "tie_rule has no effect: it belongs to fbql_literal, and the controller is fbql",
            ],
        ),
        (
            ["--controller", "fbql", "--preset", "paper"],
            ["preset has no effect: it belongs to subsumption, the controller is fbql, and no episode is guided"],
        ),
        (["--controller", "fbql", "--preset", "paper", "--policy", "none"], []),
        (["--controller", "fbql", "--preset", "paper", "--guided", "3"], []),
        (
            ["--controller", "uniform", "--set", "fbql_mirror=false", "--set", "layers=ball_seeking"],
            [
                "fbql_mirror has no effect: it belongs to fbql, fbql_model and fbql_value, and the controller is uniform",
                "layers has no effect: it belongs to subsumption, the controller is uniform, and no episode is guided",
            ],
        ),
        (["--controller", "uniform", "--no-learn"], ["--no-learn has no effect: uniform does not learn"]),
        (["--set", "max_steps=900", "--set", "reward_goal=5"], []),
    ],
)
def test_an_option_that_plays_no_part_is_said_in_a_line(words: list[str], notes: list[str]) -> None:
    assert list(match(*words).notes) == notes


def test_a_directory_is_no_policy(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"a directory; a run keeps its policy in .*/policy\.npz$"):
        match("--policy", str(tmp_path))


def test_shipped_trees_take_the_place_of_missing_ones_and_it_is_said(tmp_path: Path) -> None:
    trees = shutil.copytree(shipped_trees(), tmp_path / "trees")
    (trees / "approaching.json").unlink()
    (trees / "wall_avoiding.json").unlink()
    found = match("--trees", str(trees), "--controller", "subsumption")
    assert found.notes == (f"--trees {trees} has no tree for wall_avoiding, approaching: shipped trees play there",)
    assert [path.parent for path in found.behaviors.values()] == [trees, *[shipped_trees().resolve()] * 2]
    assert match("--trees", str(trees)).policy == shipped_policy(), "all three are the shipped ones"


def test_a_directory_without_any_tree_is_refused(tmp_path: Path) -> None:
    for place in (tmp_path, tmp_path / "absent"):
        with pytest.raises(
            BadInput, match=r"none of ball_seeking\.json, wall_avoiding\.json, approaching\.json is there"
        ):
            match("--trees", str(place))


def test_the_parents_of_a_run_are_made_below_runs_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fbql.match.options.RUNS", tmp_path / "runs")
    run = tmp_path / "runs" / "course" / "goals"
    assert make_run_directory(match("--out", str(run))).out == run
    assert (run / "log").is_dir()
    with pytest.raises(BadInput, match="there is no directory"):
        make_run_directory(match("--out", str(tmp_path / "elsewhere" / "goals")))


def test_a_behavior_without_a_tree_anywhere_is_refused(tmp_path: Path) -> None:
    trees = shutil.copytree(shipped_trees(), tmp_path / "trees")
    with pytest.raises(BadInput, match="no tree for behavior 'charging'"):
        match("--trees", str(trees), "--set", "behaviors=ball_seeking,charging")


@pytest.mark.parametrize("controller", ["fbql_value", "fbql_literal"])
def test_one_that_neither_learns_nor_has_a_policy_is_told_so(controller: str) -> None:
    assert match("--controller", controller).notes == ()
    (note,) = match("--controller", controller, "--no-learn").notes
    assert note.startswith(f"{controller} neither learns nor has a policy")


def test_a_parameter_that_the_shipped_policy_does_not_fit_names_it_and_the_way_out() -> None:
    with pytest.raises(BadInput) as refused:
        parts_of(match("--set", "fbql_world_tilings=0"))
    assert str(refused.value).startswith(f"{shipped_policy()}: the policy was learned with fbql_world_tilings 4")
    assert str(refused.value).endswith("--policy none starts untrained")
    without = match("--set", "fbql_world_tilings=0", "--policy", "none")
    assert parts_of(without).session.next_episode() is not None


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("fbql_rte=0.1", "no parameter 'fbql_rte'; did you mean fbql_rate"),
        ("nonsense=1", "no parameter 'nonsense'; docs/parameters.md has the names"),
        ("fbql_rate", "write NAME=VALUE; docs/parameters.md"),
        ("=3", "write NAME=VALUE; docs/parameters.md"),
        ("fbql_passes=1.5", "'1.5' is not a whole number"),
        ("fbql_rate=much", "'much' is not a number"),
    ],
)
def test_a_setting_that_is_none_says_what_is_meant(setting: str, says: str) -> None:
    with pytest.raises(BadInput, match=r"^--set ") as refused:
        match("--set", setting)
    assert says in str(refused.value)


def test_what_to_type_next_is_understood_for_a_controller_of_ones_own(tmp_path: Path) -> None:
    summary = {"controller": "Bandit", "messages_recorded": 0, "incomplete": False}
    words = ["--controller", bandit(tmp_path), "--set", "bandit_rate=0.5", "--set", "max_steps=900"]
    with only_ours():
        first = match(*words)
        for policy in (None, tmp_path / "policy.npz"):
            if policy is not None:
                policy.touch()
            lines = next_steps(summary, tmp_path, same_options(first), True, controller_options(first)).splitlines()
            typed = [shlex.split(line)[2:] for line in lines if "bringup.py" in line and "--watch" not in line]
            assert len(typed) == 2
            found = [match(*(each[: each.index("--realtime")] if "--realtime" in each else each)) for each in typed]
            assert asdict(found[1].fusion) == asdict(first.fusion)
            assert found[1].controller_file == first.controller_file
            assert found[0].simulation == found[1].simulation == first.simulation
            assert found[0].policy == found[1].policy == policy
            assert found[0].fusion.controller == ("subsumption" if policy is None else "Bandit")


@pytest.mark.parametrize(("name", "whose"), [("policy", "the fusion node"), ("max_steps", "the simulation")])
def test_a_controller_with_a_parameter_of_another_part_is_refused(tmp_path: Path, name: str, whose: str) -> None:
    source = bandit(tmp_path)
    path = tmp_path / "bandit.py"
    path.write_text(path.read_text().replace("bandit_random", name))
    with (
        only_ours(),
        pytest.raises(BadInput, match=f"controller 'Bandit': {whose} has a parameter '{name}' already; choose another"),
    ):
        match("--controller", source)
