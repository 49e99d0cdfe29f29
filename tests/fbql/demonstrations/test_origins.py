"""Demonstrations tell where they come from: they are driven again, compared bit for bit, and merged."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from itertools import islice
from math import inf, nextafter
from pathlib import Path

import pytest
from commands import demonstrate, replay
from fbql.demonstrations.instruct import instruct, simulation_of, starts
from fbql.demonstrations.origins import ORIGINS_KEY, Origin, about_origins, merge, origins_of, recordings_of
from fbql.demonstrations.recording import PAUSE_NS, in_sequence, save_demonstrations
from fbql.demonstrations.replay import verify
from fbql.keyboard.sitting import UNFINISHED, Kept, Safekeeping
from fbql_behaviors.core.patterns import Demonstration
from fbql_behaviors.demonstration_storage import load_demonstrations, load_recordings
from fbql_common.core.errors import BadInput
from fbql_sim.core.parameters import SimulationParameters
from file_limit import largest_file
from places import ROOT

BEHAVIOR, SEED, COUNT, STEPS = "approaching", 3, 4, 25


@pytest.fixture(autouse=True)
def no_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is to be shown to whoever runs the tests in a terminal, nor to wait for keys."""
    monkeypatch.setattr("os.isatty", lambda _: False)


@pytest.fixture(scope="module")
def demonstrations() -> list[Demonstration]:
    return instruct(BEHAVIOR, SEED, COUNT, STEPS)


@pytest.fixture
def recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """By the command, so that it says itself where it comes from."""
    out = tmp_path / "scripted"
    assert command(out, BEHAVIOR, "--seed", str(SEED), "--demonstrations", str(COUNT), "--steps", str(STEPS)) == 0
    capsys.readouterr()
    return out


def command(out: Path, *arguments: str) -> int:
    return demonstrate([*arguments, "--out", str(out), "--json"])


def seeds(count: int) -> list[int]:
    return [seed for seed, _ in islice(starts(BEHAVIOR, SEED), count)]


def changed(part: Demonstration, step: int, **values: float) -> Demonstration:
    worlds = [world._replace(**values) if world.step == step else world for world in part.worlds]
    return Demonstration(tuple(worlds), part.commands)


def origin_of(numbers: dict[int, int], simulation: SimulationParameters | None = None) -> Origin:
    return Origin("scripted", simulation or simulation_of(BEHAVIOR), numbers)


def test_an_origin_comes_back_as_it_was(recording: Path) -> None:
    (found,) = load_recordings(recording)
    (origin,) = origins_of(found.about, found.file)
    assert found.behavior == BEHAVIOR
    assert origin.simulation == simulation_of(BEHAVIOR)
    assert origin.episode_seeds == dict(enumerate(seeds(COUNT)))
    assert (origin.instructor, origin.details["seed"]) == ("scripted", SEED)


@pytest.mark.parametrize(
    "told",
    [
        "no JSON",
        "[1]",
        "[{}]",
        '{"instructor": "scripted"}',
        '[{"instructor": "x", "simulation": {"dt_s": 1e9}, "episode_seeds": {}, "details": {}}]',
        '[{"instructor": "x", "simulation": {}, "episode_seeds": {"0": -1}, "details": {}}]',
    ],
)
def test_an_origin_that_makes_no_sense_is_refused(told: str) -> None:
    with pytest.raises(BadInput, match=r"^here: the origin of its demonstrations cannot be read"):
        origins_of({ORIGINS_KEY: told}, "here")


def test_driving_again_gives_the_same_worlds_bit_for_bit(recording: Path) -> None:
    verification = verify(list(load_recordings(recording)))
    assert verification.identical
    assert verification.steps == COUNT * STEPS


def test_the_last_bit_of_one_number_is_found(demonstrations: list[Demonstration], tmp_path: Path) -> None:
    value = demonstrations[2].worlds[10].ball_x_m
    parts = [*demonstrations[:2], changed(demonstrations[2], 10, ball_x_m=nextafter(value, inf)), demonstrations[3]]
    origin = origin_of(dict(enumerate(seeds(COUNT))))
    save_demonstrations(tmp_path / "bit", BEHAVIOR, parts, about_origins([origin]))
    verification = verify(list(load_recordings(tmp_path / "bit")))
    assert not verification.identical
    assert verification.steps == 2 * STEPS + 10
    assert re.search(
        r"bit_0\.mcap: demonstration 2, step 10: ball_x_m was .* is now", verification.first_difference or ""
    )


def test_another_start_or_another_world_is_found(demonstrations: list[Demonstration], tmp_path: Path) -> None:
    numbers = dict(enumerate(seeds(COUNT)))
    slippery = replace(simulation_of(BEHAVIOR), lateral_grip_m_s2=1.0)
    for name, origin in (
        ("start", origin_of({**numbers, 1: numbers[1] + 1})),
        ("world", origin_of(numbers, slippery)),
    ):
        save_demonstrations(tmp_path / name, BEHAVIOR, demonstrations, about_origins([origin]))
        assert verify(list(load_recordings(tmp_path / name))).first_difference is not None


def test_what_does_not_say_how_it_began_is_not_called_the_same(
    demonstrations: list[Demonstration], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save_demonstrations(tmp_path / "mute", BEHAVIOR, demonstrations, {})
    verification = verify(list(load_recordings(tmp_path / "mute")))
    assert (verification.identical, verification.without_start, verification.first_difference) == (False, COUNT, None)
    assert demonstrate(["--replay", str(tmp_path / "mute"), "--json"]) == 1
    streams = capsys.readouterr()
    assert json.loads(streams.out)["identical"] is False
    assert "4 of 4 demonstrations can't be driven again" in streams.err


def test_replay_says_that_all_is_the_same(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert demonstrate(["--replay", str(recording), "--json"]) == 0
    streams = capsys.readouterr()
    assert json.loads(streams.out) == {
        "demonstrations": COUNT,
        "patterns": COUNT * 5,
        "path": str(recording),
        "identical": True,
        "steps": COUNT * STEPS,
        "first_difference": None,
    }
    assert "all 100 steps are identical, bit for bit" in streams.err


def test_in_one_sequence_episodes_count_from_zero_and_time_never_goes_back(
    demonstrations: list[Demonstration],
) -> None:
    made = in_sequence([demonstrations[3], demonstrations[1], demonstrations[1]])
    assert [part.worlds[0].episode for part in made] == [0, 1, 2]
    stamps = [world.stamp_ns for part in made for world in part.worlds]
    assert stamps == sorted(set(stamps))
    assert made[1].worlds[0].stamp_ns - made[0].worlds[-1].stamp_ns == PAUSE_NS
    for part, source in zip(made, (demonstrations[3], demonstrations[1], demonstrations[1]), strict=True):
        assert [world[2:] for world in part.worlds] == [world[2:] for world in source.worlds]
        assert [order[2:] for order in part.commands] == [order[2:] for order in source.commands]
        for world, order in zip(part.worlds, part.commands, strict=True):
            assert (world.stamp_ns, world.episode, world.step) == (order.stamp_ns, order.episode, order.step)


def test_merged_recordings_hold_all_and_can_still_be_driven_again(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other, merged = tmp_path / "other", tmp_path / "merged"
    assert command(other, BEHAVIOR, "--seed", "9", "--demonstrations", "2", "--steps", "10") == 0
    capsys.readouterr()
    assert command(merged, "--merge", str(recording), str(other)) == 0
    assert json.loads(capsys.readouterr().out) == {
        "demonstrations": 6,
        "patterns": COUNT * 5 + 2 * 2,
        "path": str(merged),
    }
    found = load_demonstrations(merged, BEHAVIOR)
    both = [*load_demonstrations(recording, BEHAVIOR), *load_demonstrations(other, BEHAVIOR)]
    assert found == in_sequence(both)
    verification = verify(list(load_recordings(merged)))
    assert (verification.identical, verification.steps) == (True, COUNT * STEPS + 20)
    demonstrations, origins = merge(recordings_of([merged, recording]))
    assert len(demonstrations) == 10
    assert [sorted(origin.episode_seeds) for origin in origins] == [[0, 1, 2, 3], [4, 5], [6, 7, 8, 9]]


def test_recordings_of_two_behaviors_are_not_merged(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other"
    assert command(other, "ball_seeking", "--demonstrations", "1", "--steps", "5") == 0
    assert command(tmp_path / "merged", "--merge", str(recording), str(other)) == 2
    assert "holds demonstrations of 'ball_seeking', not of 'approaching'" in capsys.readouterr().err
    assert not (tmp_path / "merged").exists()


@pytest.mark.parametrize("mode", ["--replay", "--merge"])
def test_a_match_is_called_one_and_what_shows_it_is_said(
    mode: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    match = ROOT / "tests" / "data" / "recorded_match"
    assert command(tmp_path / "out", mode, str(match)) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "a match of fbql, not demonstrations; `replay RUN --watch` shows a match" in said


def test_demonstrations_are_no_match_and_what_shows_them_is_said(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for change in ("--verify", "--set=weight_gain=0.5"):
        assert replay([str(recording), change]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert f"demonstrations of {BEHAVIOR}, not a match" in said
        assert f"demonstrate.py --replay {recording} drives them again" in said


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ([], "name the BEHAVIOR"),
        (["--keyboard"], "name the BEHAVIOR"),
        ([BEHAVIOR, "--keyboard"], "an interactive terminal is needed"),
        ([BEHAVIOR, "--keyboard", "--steps", "5"], "--steps cannot be combined with --keyboard"),
        ([BEHAVIOR, "--keyboard", "--realtime", "nan"], "--realtime is nan"),
        (["--replay", "x", "--merge", "y"], "exclude each other"),
        (["--replay", "nowhere"], "nowhere: no such file"),
        (["--merge", "nowhere", "nothing"], "nowhere: no such file"),
        (["dance", "--keyboard"], "unknown behavior 'dance'"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_code_2(
    arguments: list[str], reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = command(tmp_path / "out", *arguments)
    except SystemExit as end:
        code = end.code
    assert code == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert reason in lines[0]
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def kept(demonstrations: list[Demonstration]) -> list[Kept]:
    return [Kept(seed, part) for seed, part in zip(seeds(COUNT), demonstrations, strict=True)]


def safekeeping(directory: Path) -> Safekeeping:
    made = Safekeeping(directory, BEHAVIOR, simulation_of(BEHAVIOR), {})
    made.open()
    return made


def test_what_is_kept_can_be_read_while_the_sitting_goes_on(kept: list[Kept], tmp_path: Path) -> None:
    keeping = safekeeping(tmp_path / "sitting")
    for each in kept[:3]:
        assert keeping.keep(each) is None
    keeping.drop()
    keeping.keep(kept[3])
    found = load_demonstrations(tmp_path / "sitting", BEHAVIOR)
    assert [part.worlds[5][3:] for part in found] == [kept[k].demonstration.worlds[5][3:] for k in (0, 1, 3)]
    assert verify(list(load_recordings(tmp_path / "sitting"))).identical


def test_a_finished_sitting_is_one_recording_as_any_other(kept: list[Kept], tmp_path: Path) -> None:
    keeping = safekeeping(tmp_path / "sitting")
    for each in kept:
        keeping.keep(each)
    assert keeping.finish(kept)
    assert sorted(path.name for path in (tmp_path / "sitting").iterdir()) == ["metadata.yaml", "sitting_0.mcap"]
    assert load_demonstrations(tmp_path / "sitting", BEHAVIOR) == in_sequence(each.demonstration for each in kept)


def test_a_sitting_without_a_demonstration_leaves_nothing(kept: list[Kept], tmp_path: Path) -> None:
    keeping = safekeeping(tmp_path / "sitting")
    keeping.keep(kept[0])
    keeping.drop()
    assert keeping.finish([])
    assert list(tmp_path.iterdir()) == []


def test_where_the_recording_fails_the_copies_stay(kept: list[Kept], tmp_path: Path) -> None:
    directory = tmp_path / "sitting"
    keeping = safekeeping(directory)
    for each in kept:
        assert keeping.keep(each) is None
    reports: list[str] = []
    with largest_file(max(path.stat().st_size for path in directory.rglob("*.mcap")) + 200):
        assert not keeping.finish(kept, reports.append)
    (line,) = reports
    assert line == f"{directory}: cannot be written (File too large); what was kept is in {UNFINISHED} there"
    assert [path.name for path in directory.iterdir()] == [UNFINISHED]
    assert len(load_demonstrations(directory / UNFINISHED, BEHAVIOR)) == len(kept)


def test_a_copy_that_does_not_fit_is_reported_and_leaves_nothing(kept: list[Kept], tmp_path: Path) -> None:
    keeping = safekeeping(tmp_path / "sitting")
    with largest_file(9000):
        said = keeping.keep(kept[0])
    assert said is not None
    assert "File too large); make room there" in said
    assert list(tmp_path.rglob("*.mcap*")) == []
