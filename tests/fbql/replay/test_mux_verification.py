"""`replay.py RUN --verify` of a mux: every decision is made again on its recorded snapshot, bit by bit."""

from __future__ import annotations

import itertools
import json
import math
import random
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from commands import recover, replay, report
from fbql_common.core.mux_types import MuxDecision
from fbql_common.wire import decode_mux_decision, encode_mux_decision
from fbql_recording.mcap.reader import Message
from fbql_recording.run import open_run
from fuzzing import dice, finite_json
from recorded_rail import record_rail
from rewritten_run import rewrite

DECISION = "/fusion/decision"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that learns. Not to be changed."""
    return record_rail(tmp_path_factory.mktemp("mux") / "run")


def verify(run: Path, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, dict[str, Any]]:
    code = replay([str(run), "--verify", "--json", *options])
    return code, finite_json(capsys.readouterr().out)


def is_identical(run: Path, capsys: pytest.CaptureFixture[str]) -> int:
    """Asserts that every decision is; gives their number."""
    code, found = verify(run, capsys)
    assert (code, found["identical"], found["first_difference"]) == (0, True, None)
    assert found["steps"] == open_run(run).counts[DECISION] > 0
    assert found["digest"] == json.loads((run / "summary.json").read_text())["digest"]
    return found["steps"]


@pytest.mark.parametrize(
    "changes",
    [{"fbql_prior": 3.0}, {"controller": "fbql_value"}, {"controller": "uniform"}, {"learn": False, "controller": "priorities"}],
    ids=str,
)  # fmt: skip
def test_every_controller_is_recomputed_bit_by_bit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changes: dict[str, Any]
) -> None:
    is_identical(record_rail(tmp_path / "run", **changes), capsys)


def test_episodes_of_which_nobody_told_the_outcome_are_recomputed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = record_rail(tmp_path / "run", silent=range(40, 120), segment_s=2.0)
    is_identical(run, capsys)
    decisions = [decode_mux_decision(message.data) for message in open_run(run).messages([DECISION])]
    left_out = [b for a, b in itertools.pairwise(decisions) if b.episode == a.episode and b.step == a.step + 2]
    assert len(left_out) > 2
    assert all(each.degraded for each in left_out)


def test_a_run_that_learns_and_one_that_starts_from_its_policy_are_recomputed(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert is_identical(recorded, capsys) > 200
    policy = str(recorded / "policy.npz")
    assert is_identical(record_rail(tmp_path / "more", 5, policy=policy), capsys) > 50
    assert is_identical(record_rail(tmp_path / "frozen", 5, policy=policy, learn=False), capsys) > 50


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("driver", 0),
        ("learned_weights", (0.25, 0.75)),
        ("joint_state", (0, 25)),
        ("command", (0.25, 0.0)),
        ("reward", 0.5),
    ],
)
def test_the_first_decision_that_differs_is_named(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], field: str, value: Any
) -> None:
    decisions = [decode_mux_decision(message.data) for message in open_run(recorded).messages([DECISION])]
    # Of a decision that drove up, at which nothing was achieved.
    place = next(k for k, d in enumerate(decisions) if k > 150 and d.driver == 1 and d.reward == 0.0 and d.step > 2)

    def change(message: Message) -> bytes:
        if message.topic != DECISION or message.data != encode_mux_decision(decisions[place]):
            return message.data
        changed = decisions[place]._replace(**{field: value})
        # A reward is what the decision was made on, so that only what follows from it can differ.
        return encode_mux_decision(changed._replace(degraded=True) if field == "reward" else changed)

    code, found = verify(rewrite(recorded, tmp_path / "changed", change), capsys)
    assert (code, found["identical"], found["steps"]) == (1, False, place)
    named = "degraded" if field == "reward" else field
    assert found["first_difference"]["what"] == f"{named} of the decision"
    assert found["first_difference"]["episode"] == decisions[place].episode


def test_a_decision_that_is_missing_in_a_whole_recording_is_a_difference(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    number = iter(range(10**6))
    lacks = rewrite(
        recorded, tmp_path / "lacks", lambda m: None if m.topic == DECISION and next(number) == 100 else m.data
    )
    code, found = verify(lacks, capsys)
    assert (code, found["steps"], found["first_difference"]["what"]) == (1, 100, "the schedule")


def test_of_a_recording_that_was_cut_off_and_recovered_the_decisions_before_the_cut_are_compared(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    torn = tmp_path / "torn"
    shutil.copytree(recorded, torn)
    (mcap,) = torn.glob("*.mcap")
    mcap.write_bytes(mcap.read_bytes()[: mcap.stat().st_size // 2])
    (torn / "metadata.yaml").unlink()
    assert recover([str(torn), "--out", str(tmp_path / "recovered")]) in (0, 3)
    capsys.readouterr()
    code, found = verify(tmp_path / "recovered", capsys)
    assert (code, found["identical"]) == (3, True)
    assert found["steps"] == open_run(tmp_path / "recovered").counts[DECISION] > 20


def test_other_parameters_than_were_recorded_are_a_difference_and_wrong_ones_one_line(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = yaml.safe_load(open_run(recorded).attachments["config.yaml"])
    for name, (change, code, said) in {
        "seed": ({"seed": 9}, 1, ""),
        "axes": (
            {"axes": {"linear_w": {"low": 0.0, "high": 1.0}}},
            2,
            "config.yaml: parameter 'axes.linear_w': not an axis",
        ),
        "observations": (
            {"observations": {}},
            2,
            "its decisions do not match the sources and observations in its config.yaml",
        ),
        "learn": ({"learn": 3}, 2, "config.yaml: parameter 'learn' must be true or false"),
    }.items():
        copy = rewrite(recorded, tmp_path / name, lambda m: m.data, leave_out=("config.yaml",))
        changed = {**config, "parameters": {"twist_mux": {**config["parameters"]["twist_mux"], **change}}}
        (copy / "config.yaml").write_text(yaml.safe_dump(changed))
        assert replay([str(copy), "--verify"]) == code, name
        out, err = capsys.readouterr()
        assert said in err
        assert "Traceback" not in out + err


def test_what_is_for_runs_of_soccer_refuses_a_run_of_a_mux_in_one_line(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for command, words in (
        (report, ["--out", str(tmp_path / "page.html"), "--figures"]),
        (replay, ["--set", "weight_gain=0.1"]),
    ):
        assert command([str(recorded), *words]) == 2
        _, err = capsys.readouterr()
        assert "of a mux" in err.splitlines()[-1]
        assert len(err.splitlines()) == 1


ODD: dict[type, tuple[Any, ...]] = {
    float: (math.nan, math.inf, -1e308, 0.0),
    int: (-1, 0, 2**31 - 1),
    str: ("", "\x1b[2J\n", "x" * 3000),
    bool: (True, False),
}


def odd_field(decision: MuxDecision, rng: random.Random) -> MuxDecision:
    """The decision with another value in a field, or another number of values."""
    name = rng.choice(decision._fields)
    value = getattr(decision, name)
    if not isinstance(value, tuple):
        return decision._replace(**{name: rng.choice(ODD[type(value)])})
    odd = tuple(rng.choice(ODD[type(each)]) for each in value)
    return decision._replace(**{name: rng.choice(((), value + value, value[:-1], odd))})


@pytest.mark.parametrize("name", ["commands", "ages_s", "active", "observed"])
@pytest.mark.parametrize(
    "how", [lambda _: (), lambda value: value[:-1], lambda value: value * 2], ids=["none", "fewer", "more"]
)
def test_a_snapshot_of_other_sources_or_observations_is_one_line(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, how: Callable[..., tuple[Any, ...]]
) -> None:
    def change(message: Message) -> bytes:
        if message.topic != DECISION:
            return message.data
        decision = decode_mux_decision(message.data)
        return encode_mux_decision(decision._replace(**{name: how(getattr(decision, name))}))

    odd = rewrite(recorded, tmp_path / "odd", change)
    assert replay([str(odd), "--verify"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("its decisions do not match the sources and observations in its config.yaml")


def test_any_decisions_are_compared_or_refused(recorded: Path, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number, rng in enumerate(dice(10)):
        chosen = {rng.randrange(50) for _ in range(2)}
        places = iter(range(10**6))

        def change(
            message: Message, chosen: set[int] = chosen, places: Iterator[int] = places, rng: random.Random = rng
        ) -> bytes:
            if message.topic != DECISION or next(places) not in chosen:
                return message.data
            return encode_mux_decision(odd_field(decode_mux_decision(message.data), rng))

        odd = rewrite(recorded, place / f"odd_{number}", change)
        for command, words in ((replay, ["--verify"]), (report, ["--out", str(place / f"{number}.html")])):
            code = command([str(odd), *words])
            out, err = capsys.readouterr()
            assert code in (0, 1, 2)
            assert all(line.isprintable() for line in [*out.splitlines(), *err.splitlines()])
            assert code != 2 or (out, err.count("\n")) == ("", 1)
