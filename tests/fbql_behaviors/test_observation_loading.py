"""Where observations come from: this package, a file that the user names, an installed package; and what cannot be used."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fbql.cli.observations import register_observations
from fbql_behaviors import observation_loading
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.core.instructors import INSTRUCTORS, instructor_of
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.tree import Leaf, Tree
from fbql_behaviors.observation_loading import GROUP, find_observation, load_observation
from fbql_common.core.errors import BadInput
from fbql_common.core.types import World
from fbql_common.core.walls import closest_wall_point

WORLD = World(1, 0, 0, 0.25, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.9, 0.0, *[False] * 6)
SOUND = """
from fbql_behaviors.core.observation import Feature, Observation

def sense(world):
    return (world.robot_x_m,)

def law(observation):
    return (10.0, 20.0)

pacing = Observation((Feature("robot_x", "m", -1.2, 1.2),), sense, law)
"""
Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write_file(text: str = SOUND, name: str = "mine.py") -> Path:
        path = tmp_path / name
        path.write_text(text)
        return path

    return write_file


@pytest.fixture(autouse=True)
def forget() -> Iterator[None]:
    """What a test makes known is known in that test alone."""
    before = dict(OBSERVATIONS)
    yield
    OBSERVATIONS.clear()
    OBSERVATIONS.update(before)


def test_a_file_brings_an_observation_named_after_its_behavior(write: Write) -> None:
    path = write()
    for source in (f"{path}:pacing", str(path)):
        behavior, observation, found = load_observation(source)
        assert (behavior, found) == ("pacing", f"{path}:pacing")
        assert observation.sense(WORLD) == (0.25,)
        assert [feature.name for feature in observation.features] == ["robot_x"]


def test_a_file_is_run_once_in_a_process_and_found_from_anywhere(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(SOUND + "\nopen(__file__ + '.ran', 'a').write('x')\n")
    monkeypatch.chdir(path.parent)
    first, second = load_observation("mine.py:pacing"), load_observation(f"{path}:pacing")
    assert first == second
    assert first.source == f"{path}:pacing"
    assert Path(f"{path}.ran").read_text() == "x"


def test_a_file_is_used_where_it_is_named_and_only_for_its_behavior(write: Write) -> None:
    source = f"{write()}:pacing"
    assert find_observation("pacing", source).sense(WORLD) == (0.25,)
    with pytest.raises(BadInput, match="is the observation of behavior 'pacing', not of 'seeking'"):
        find_observation("seeking", source)
    with pytest.raises(BadInput, match=r"unknown behavior 'pacing'.*FILE\.py:pacing, or an installed package's"):
        find_observation("pacing")


def test_this_packages_behaviors_need_no_file() -> None:
    assert find_observation("ball_seeking") is OBSERVATIONS["ball_seeking"]


@pytest.mark.parametrize(
    ("text", "name", "reason"),
    [
        ("x = 1\n", "", r"which Observation\? write mine.py:NAME; it has none"),
        (SOUND, ":other", r"write mine.py:NAME; it has: pacing"),
        (SOUND + "racing = Observation(pacing.features, sense)\n", "", r"it has: pacing, racing"),
        (SOUND, ":law", r"which Observation"),
        ("def (\n", "", "mine.py: SyntaxError in line 1: "),
        ("\n\nimport no_such_module\n", "", "mine.py: ModuleNotFoundError in line 3: No module named 'no_such_module'"),
        ("\n1 / 0\n", "", "mine.py: ZeroDivisionError in line 2: division by zero"),
        (SOUND.replace("-1.2, 1.2", "1.2, -1.2"), "", "feature 'robot_x': low 1.2 must be below high -1.2"),
        (SOUND.replace("(Feature(", "() and (Feature("), "", "needs features, each with its own name"),
        (SOUND.replace("sense, law", "1, law"), "", "'sense' of behavior 'pacing' is not a function"),
        (SOUND.replace("robot_x_m,)", "robot_x_m, 1.0)"), "", "'pacing' returns 2 values; expected 1: robot_x"),
        (SOUND.replace("robot_x_m,)", "robot_x_m)"), "", "'pacing' returns a float instead of a tuple; expected 1"),
        (
            SOUND.replace("robot_x_m,)", "goal and 0 or None,)"),
            "",
            "'pacing' returns a NoneType as 'robot_x', expected",
        ),
        (
            SOUND.replace("world.robot_x_m,)", "float('nan'),)"),
            "",
            "returns nan as 'robot_x', expected a finite number",
        ),
        (SOUND.replace("robot_x_m,)", "goal,)"), "", "returns a bool as 'robot_x', expected a number"),
        (SOUND.replace("(world)", "(world, more)"), "", r"TypeError: sense\(\) missing 1"),
        (
            SOUND.replace("return (world", "import statistics; return (statistics.mean([]) + world"),
            "",
            "Error in line 5: ",
        ),
        (SOUND.replace("robot_x_m,)", "robot_x,)"), "", "'sense' of behavior 'pacing': AttributeError in line 5: "),
        (SOUND.replace("sense, law", "sense, 1"), "", "'instructor' of behavior 'pacing' is not a function"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_in_one_line_with_the_reason(
    write: Write, text: str, name: str, reason: str
) -> None:
    with pytest.raises(BadInput, match=reason) as refusal:
        load_observation(f"{write(text)}{name}")
    assert "\n" not in str(refusal.value)


def test_the_world_state_that_an_observation_is_tried_on_is_one_of_the_simulator() -> None:
    found = observation_loading._SAMPLE
    wall = closest_wall_point(found.robot_x_m, found.robot_y_m)
    assert (found.wall_x_m, found.wall_y_m, found.wall_yaw_rad) == pytest.approx(wall)


def test_an_instructor_is_asked_only_for_demonstrations(write: Write) -> None:
    assert load_observation(str(write(SOUND.replace("return (10.0, 20.0)", "raise ValueError")))).behavior == "pacing"


def test_a_file_that_is_not_there_or_is_no_python_is_refused(write: Write) -> None:
    with pytest.raises(BadInput, match=r"missing.py: no such file"):
        load_observation("missing.py:pacing")
    with pytest.raises(BadInput, match="an observation is a Python file"):
        load_observation(f"{write(name='mine.json')}:pacing")


def installed(place: Path, value: str, text: str = SOUND, package: str = "their_behaviors") -> None:
    """An installed distribution whose entry point says that its module has the observation of `pacing`."""
    (place / f"{package}.py").write_text(text)
    about = place / f"{package}-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(f"[{GROUP}]\npacing = {value}\n")


def test_an_installed_package_brings_an_observation_by_its_entry_point(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed(tmp_path, "their_first:pacing", package="their_first")
    monkeypatch.syspath_prepend(tmp_path)
    assert find_observation("pacing").sense(WORLD) == (0.25,)
    assert register_observations([], ["pacing"]) == {}
    assert OBSERVATIONS["pacing"].sense(WORLD) == (0.25,)


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        ("their_second:law", "pacing = their_second:law: is a function, expected an Observation"),
        ("their_second:nothing", "AttributeError"),
        ("no_such_module:pacing", "ModuleNotFoundError"),
    ],
)
def test_an_installed_package_that_cannot_be_used_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, value: str, reason: str
) -> None:
    installed(tmp_path, value, package="their_second")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(BadInput, match=reason):
        find_observation("pacing")


def test_two_packages_for_one_behavior_are_refused_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    installed(tmp_path, "their_third:pacing", package="their_third")
    installed(tmp_path, "their_fourth:pacing", package="their_fourth")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(BadInput, match="installed twice: their_fourth:pacing, their_third:pacing"):
        find_observation("pacing")


def test_what_a_command_is_told_is_known_from_then_on(write: Write) -> None:
    path = write()
    assert register_observations([str(path)], ["pacing"]) == {"pacing": f"{path}:pacing"}
    register_observations([str(path)])
    assert instructor_of("pacing")((0.0,)) == (10.0, 20.0)
    tree = Tree("pacing", OBSERVATIONS["pacing"].features, (0,), (Leaf(1.0, 2.0, 3),))
    assert Behavior("pacer", tree).answer(WORLD).observation == (0.25,)
    with pytest.raises(BadInput, match=r"behavior 'pacing' has two observations, .*pacing and .*other\.py; name one"):
        register_observations([str(path), str(write(name="other.py"))])
    register_observations([str(write(SOUND.replace("20.0", "30.0"), name=path.name))])
    assert instructor_of("pacing")((0.0,)) == (10.0, 30.0), "a file that was edited"


def test_an_observation_without_an_instructor_has_none(write: Write) -> None:
    register_observations([str(write(SOUND.replace("sense, law", "sense")))])
    with pytest.raises(BadInput, match="'pacing' has no scripted instructor"):
        instructor_of("pacing")
    assert instructor_of("ball_seeking") is INSTRUCTORS["ball_seeking"]
