"""`induce.py --bag`: a tree of any robot from a bag that others recorded; explained, exported and reported like any other."""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import induce, tree
from fbql.demonstrations.from_bags import FINEST_HALVINGS, MOST_BOXES, bag_request, halvings_for, most_boxes
from fbql_behaviors.bag_reading import load_spec, read_bag
from fbql_behaviors.core.bag_patterns import patterns_of_bags
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.core.boxes import MAX_GRIDS, MAX_HALVINGS
from fbql_behaviors.core.c_source import to_c
from fbql_behaviors.core.evaluation import wheel_rmse
from fbql_behaviors.core.explanation import rules
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.storage import load_tree, tree_from_bytes, tree_to_bytes
from fbql_common.core.errors import BadInput
from robot_bags import SPEC, TWIST, drive, teleoperated, twist, write_bag

NAME = "keep_clear"


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with behavior.yaml, a bag in either storage, and one of another drive."""
    place = tmp_path_factory.mktemp("bags")
    (place / "behavior.yaml").write_text(SPEC)
    for storage in ("mcap", "sqlite3"):
        write_bag(place / storage, drive(1).messages, storage)
    write_bag(place / "other", drive(2).messages)
    return place


def induced(capsys: pytest.CaptureFixture[str], place: Path, *words: str, bag: str = "mcap") -> dict[str, Any]:
    given = [NAME, "--bag", str(place / bag), "--spec", str(place / "behavior.yaml"), "--json"]
    assert induce([*given, "--out", str(place / "tree.json"), *words]) == 0
    out = capsys.readouterr().out
    assert out.count("\n") == 1
    return json.loads(out)


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert induce(list(words)) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    return said.err


@pytest.mark.parametrize("method", ["rl", "dp", "cart"])
def test_the_tree_reproduces_the_rule_on_a_drive_that_it_was_not_made_from(
    method: str, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if method == "cart":
        pytest.importorskip("sklearn.tree")
    result = induced(capsys, place, "--method", method)
    made = load_tree(place / "tree.json")
    spec = load_spec(place / "behavior.yaml")
    unseen = patterns_of_bags(spec, [read_bag(place / "other", spec).events]).patterns
    expected = np.array([teleoperated(*row) for row in unseen.x.tolist()])
    wrong = np.abs(made.references(unseen.x) - expected).max(axis=1) > 1e-9
    assert wrong.mean() <= (0.02 if method == "cart" else 0.0), "half-splits meet the rule's 1 m exactly, CART nearly"
    assert wheel_rmse(made, unseen) == pytest.approx(0.0, abs=1e-9 if method != "cart" else 0.6)
    assert result["rmse_levels"] < 0.6
    assert (result["commands"], result["dropped"], result["patterns"]) == (400, {}, 400)
    assert set(result["training_rmse"]) == {"linear.x", "angular.z"}
    assert result["rmse_rad_s"] is None, "its axes have units of their own"


def test_the_next_steps_are_commands_of_a_clone(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tree = str(place / "next.json")
    assert induce([NAME, "--bag", str(place / "mcap"), "--spec", str(place / "behavior.yaml"), "--out", tree]) == 0
    node = f"scripts/ros2 run fbql_behaviors twist_behavior --ros-args -p tree_file:={tree}"
    assert f"  {node}\n" in capsys.readouterr().err


def test_both_storages_give_the_same_tree(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert induced(capsys, place)["sha256"] == induced(capsys, place, bag="sqlite3")["sha256"]


def test_the_file_says_axes_and_recipe_and_reads_back_the_same(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    induced(capsys, place)
    data = (place / "tree.json").read_bytes()
    content = json.loads(data)
    assert content["commands"][0] == {"name": "linear.x", "unit": "m/s", "low": 0.0, "high": 0.8, "levels": 9}
    assert content["recipe"]["types"] == {"/scan": "sensor_msgs/msg/LaserScan", "/cmd_vel": "geometry_msgs/msg/Twist"}
    assert content["recipe"]["observations"][0]["field"] == "ranges[0:4].min"
    assert tree_to_bytes(tree_from_bytes(data)) == data
    for change in (
        lambda: content["recipe"].pop("types"),
        lambda: content.pop("commands"),
        lambda: content["leaves"][0].update(command=[0.1]),
    ):
        change()
        with pytest.raises(BadInput):
            tree_from_bytes(json.dumps(content).encode())


def test_it_is_explained_with_its_own_axes(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    induced(capsys, place, "--report")
    near, *_, far = (rule.sentence for rule in rules(load_tree(place / "tree.json")))
    assert near.startswith("right nearer than 1 m -> slow forwards, turning left (linear.x 0.2 m/s, angular.z 1 rad/s;")
    assert "-> fast forwards (linear.x 0.8 m/s, angular.z 0 rad/s;" in far
    assert tree(["explain", str(place / "tree.json"), "--at", "0.5,3", "--json"]) == 0
    (leaf,) = json.loads(capsys.readouterr().out)["leaves"]
    assert leaf["command"] == {"linear.x": 0.2, "angular.z": 1.0}
    page = (place / "tree.html").read_text()
    assert "linear.x [m/s]" in page
    assert "400 commands in the bags" in page
    for form in ("dot", "svg", "json"):
        assert tree(["export", str(place / "tree.json"), "--to", form]) == 0
    assert "linear.x 0.2 m/s, angular.z 1 rad/s" in capsys.readouterr().out


def test_its_c_function_answers_like_the_tree(place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("there is no gcc here")
    induced(capsys, place)
    made = load_tree(place / "tree.json")
    (tmp_path / "tree.c").write_text(to_c(made))
    flags = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1", "-shared", "-fPIC")
    subprocess.run([compiler, *flags, "tree.c", "-o", "tree.so"], cwd=tmp_path, check=True, timeout=120)
    answer = getattr(ctypes.CDLL(str(tmp_path / "tree.so")), f"{NAME}_answer")
    pair = ctypes.c_double * 2
    for point in np.random.default_rng(0).uniform(-1.0, 5.0, (500, 2)).tolist():
        command = pair()
        assert (answer(pair(*point), command), *command) == made.answer(point)


def test_several_bags_are_several_demonstrations(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert induced(capsys, place, "--bag", str(place / "other"), "--every", "2")["patterns"] == 400


def test_six_features_get_regions_as_coarse_as_the_table_allows(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    beams = "".join(
        f'  beam{k}: {{topic: /scan, field: "ranges[{2 * k}]", low: 0.0, high: 4.0, unit: m}}\n' for k in range(6)
    )
    spec = SPEC.partition("observations:\n")[0] + "observations:\n" + beams + SPEC[SPEC.index("command:") :]
    (place / "six.yaml").write_text(spec)
    assert (
        induced(capsys, place, "--spec", str(place / "six.yaml"), "--method", "dp", "--patterns", "100")["leaves"] > 1
    )


@pytest.mark.parametrize("features", range(1, 11))
def test_regions_are_as_fine_as_the_table_of_boxes_allows(features: int) -> None:
    halvings = halvings_for(features, 1)
    assert (halvings + 1) ** features <= MAX_GRIDS
    assert (
        halvings == FINEST_HALVINGS
        or (halvings + 2) ** features > MAX_GRIDS
        or features * (halvings + 1) > MAX_HALVINGS
    )


def test_many_patterns_of_many_features_get_coarser_regions() -> None:
    assert [halvings_for(features, 2000) for features in (1, 2, 3, 4, 6)] == [6, 6, 5, 3, 2]
    by_hand = {h: sum(min(2000, 2 ** sum(grid)) for grid in product(range(h + 1), repeat=3)) for h in (5, 6)}
    assert by_hand[5] <= MOST_BOXES < by_hand[6], "of three features"
    assert most_boxes(2, 3, 10**9) == 15**2, "the cells of all grids"
    assert most_boxes(2, 3, 1) == 4**2, "one box of each grid"


def test_more_than_ten_observations_are_refused() -> None:
    with pytest.raises(BadInput, match="11 observations; at most 10 are supported"):
        bag_request(NAME, 11)


def test_soccer_does_not_play_it(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    induced(capsys, place)
    with pytest.raises(BadInput, match=r"the tree of 'keep_clear' commands linear\.x, angular\.z, not wheels"):
        Behavior(NAME, load_tree(place / "tree.json"), OBSERVATIONS["ball_seeking"])


def test_what_can_t_be_is_refused_in_one_line(place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag, spec = ("--bag", str(place / "mcap")), ("--spec", str(place / "behavior.yaml"))
    still = tmp_path / "still"
    write_bag(still, [(*m[:3], twist(0.5, 0.0)) if m[1] == TWIST else m for m in drive(3, 50).messages])
    for words, problem in (
        ((NAME, *bag), "--bag needs --spec FILE"),
        ((NAME, *spec), "--spec says what to take from a bag: name one with --bag DIR"),
        ((NAME, *bag, *spec, "--demos", str(place)), "--bag and --demos exclude each other"),
        (("ball_seeking", *bag, *spec), "'ball_seeking' can't be the name of a tree from a bag"),
        (("../x", *bag, *spec), "'../x' can't be the name"),
        ((NAME, "--bag", str(tmp_path), *spec), "not a bag"),
        ((NAME, "--bag", str(still), *spec), "is the same in all 50 patterns (linear.x 0.5, angular.z 0, rounded"),
        ((NAME, *bag, *spec, "--every", "0"), "every is 0; it must be at least 1"),
    ):
        assert problem in refused(capsys, *words)
