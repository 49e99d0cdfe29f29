"""The animated picture of a match: what was recorded, at the time at which it was, in the report's colours."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from fbql.pictures.colours import behavior_colour, report_colours
from fbql.pictures.episode import HELD_S, SCALE, main, picture, read_episodes
from fbql_common.core.errors import BadInput
from places import ROOT
from recorded_match import record_match

SVG = "{http://www.w3.org/2000/svg}"
IN_README = ROOT / "docs" / "images" / "match.svg"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_match(tmp_path_factory.mktemp("run") / "run", controller="subsumption", episodes=3, max_steps=200)


def drawn(run: Path, *episodes: int) -> ElementTree.Element:
    return ElementTree.fromstring(picture(read_episodes(run, episodes)))


def values_of(animation: ElementTree.Element) -> list[tuple[float, str]]:
    """Time as a share of the whole, and value."""
    times = [float(each) for each in animation.attrib["keyTimes"].split(";")]
    return list(zip(times, animation.attrib["values"].split(";"), strict=True))


def test_robot_and_ball_are_where_they_were_when_they_were(run: Path) -> None:
    parts = read_episodes(run, [0, 1, 2])
    whole_s = parts[-1].end_s
    groups = [group for group in drawn(run, 0, 1, 2).findall(f"{SVG}g") if group.get("visibility")]
    assert len(groups) == 3
    for part, group in zip(parts, groups, strict=True):
        robot, ball = (g for g in group.findall(f"{SVG}g"))
        for moving, x, y in ((robot, "robot_x_m", "robot_y_m"), (ball, "ball_x_m", "ball_y_m")):
            animation = moving.find(f"{SVG}animateTransform")
            assert animation is not None
            for time, value in values_of(animation):
                step = min(range(len(part.worlds)), key=lambda k: abs(part.at_s(k) - time * whole_s))
                world = part.worlds[step]
                place = [float(each) for each in value.split()]
                assert place == pytest.approx([SCALE * getattr(world, x), -SCALE * getattr(world, y)], abs=6.0)


def test_one_episode_is_shown_at_a_time_and_its_end_is_held(run: Path) -> None:
    parts = read_episodes(run, [0, 1, 2])
    whole_s = parts[-1].end_s
    shown: list[tuple[float, float]] = []
    for group in drawn(run, 0, 1, 2).findall(f"{SVG}g[@visibility]"):
        turns = [*values_of(group.find(f"{SVG}animate")), (1.0, "hidden")]  # type: ignore[arg-type]
        begin = next(time for time, value in turns if value == "visible")
        shown.append((begin, next(time for time, value in turns if time > begin and value == "hidden")))
    assert [end for _, end in shown[:-1]] == pytest.approx([begin for begin, _ in shown[1:]])
    assert [(end - begin) * whole_s for begin, end in shown] == pytest.approx(
        [part.duration_s + HELD_S for part in parts], abs=0.01
    )


def test_what_belongs_to_an_episode_is_hidden_with_it(run: Path) -> None:
    """A part that is visible is shown even where the whole is hidden."""
    for group in drawn(run, 0, 1, 2).findall(f"{SVG}g[@visibility]"):
        assert group.findall(f".//{SVG}text/{SVG}animate"), "there are signs"
        assert len(group.findall(f".//{SVG}animate[@attributeName='visibility']")) == 1


def test_a_trail_has_the_colour_of_whoever_drove_and_the_colours_are_the_reports(run: Path) -> None:
    (part,) = read_episodes(run, [1])
    trails = drawn(run, 1).findall(f".//{SVG}polyline[@stroke-width='3.5']")
    drivers = [part.decisions[0].driver]
    for decision in part.decisions[: len(part.worlds) - 1]:
        drivers += [decision.driver] if decision.driver != drivers[-1] else []
    assert [trail.get("stroke") for trail in trails] == [behavior_colour(driver) for driver in drivers]
    used = set(re.findall(r"#[0-9a-f]{3,6}\b", picture([part])))
    assert used <= set(report_colours().values())


def test_without_animations_the_first_episode_is_shown(run: Path) -> None:
    groups = drawn(run, 0, 1).findall(f"{SVG}g[@visibility]")
    assert [group.get("visibility") for group in groups] == ["visible", "hidden"]
    (alone,) = drawn(run, 2).findall(f"{SVG}g[@visibility]")
    assert alone.find(f"{SVG}animate") is None


def test_the_command_draws_what_is_there_and_refuses_what_is_not(run: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "picture.svg"
    assert main([str(run), "--episode", "0", "2", "--out", str(out)]) == 0
    assert out.read_text() == picture(read_episodes(run, [0, 2]))
    assert main([str(run), "--episode", "7", "--out", str(out)]) == 2
    assert capsys.readouterr().err.endswith("no episode 7 in the recording\n")
    with pytest.raises(BadInput):
        read_episodes(run, [3])


def test_the_picture_of_the_readme_is_small_moves_and_comes_first() -> None:
    assert IN_README.stat().st_size < 200_000
    root = ElementTree.fromstring(IN_README.read_text())
    assert len(root.findall(f".//{SVG}animateTransform")) >= 6
    readme = (ROOT / "README.md").read_text()
    assert re.match(r"# [^\n]*\n\n!\[[^\]]+\]\(docs/images/match\.svg\)\n", readme)
