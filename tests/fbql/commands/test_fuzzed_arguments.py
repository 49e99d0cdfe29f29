"""Whatever is typed behind a command: it is done, or refused in one line with exit code 2, and stdout holds only the
result."""

from __future__ import annotations

import argparse
import random
import shutil
from collections.abc import Callable
from contextlib import closing
from importlib import import_module
from pathlib import Path

import commands
import pytest
from fbql.cli.interrupts import Interrupts
from fbql.cli.output import LiveLine
from fbql_behaviors.shipped import shipped_trees
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import limits_of, types_of
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.shipped import shipped_policy
from fbql_sim.core.parameters import SimulationParameters
from fbql_studies.runner.study import STUDIES, study_of
from fuzzing import LONGEST_COMMAND_S, bounded, dice, finite_json, odd_word
from recorded_match import record_match

NUMBERS = ("0", "1", "2", "3", "-1", "1.5", "0.1", "1e3", "nan", "inf", "-inf", "1e-320", "1e400", "", "x", "0x1", "1_0", "\u0663",
           str(2**63), str(-(2**63)), str(10**30), "9" * 5000, " 1", "1 ", "+1", "true", "\ud800")  # fmt: skip
"""None of them, as a count, makes a command play for long."""
PARAMETERS = (FusionParameters, SimulationParameters)
SLOW = {"planning_sweeps", "replay_updates", "max_steps", "episodes", "goals", "guided"}
"""Parameters of --set that are not given odd values: of two sound runs one may take long."""


@pytest.fixture(scope="module")
def things(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """Sound values, by the name of the argument. Any may be taken for an output: all of them are copies."""
    place = tmp_path_factory.mktemp("things")
    runs = [record_match(place / name, max_steps=5, episodes=2, seed=seed) for seed, name in enumerate(("a", "b"))]
    demonstrations = place / "demonstrations"
    short = ["--demonstrations", "2", "--steps", "30", "--out", str(demonstrations)]
    assert commands.demonstrate(["ball_seeking", *short]) == 0
    trees = Path(shutil.copytree(shipped_trees(), place / "trees"))
    policy = shutil.copy(shipped_policy(), place / "policy.npz")
    tree_files = [str(path) for path in sorted(trees.glob("*.json"))]
    recorded = [*map(str, runs), *(str(next(run.glob("*.mcap"))) for run in runs)]
    behaviors = ["ball_seeking", "wall_avoiding", "approaching"]
    return {
        "run": recorded, "runs": recorded, "file": tree_files, "behavior": behaviors, "demos": [str(demonstrations)],
        "trees": [str(trees)], "policy": [str(policy), "none", "given.npz"], "controller": ["fbql", "subsumption", "fbql_literal"],
        "replay": [str(demonstrations)], "merge": [str(demonstrations)], "at": ["1,0", "-5,3"],
        "observation": [f"{place}/own.py:NAME"], "topics": ["/world", "/x"], "scheduler": ["tcp://127.0.0.1:9"],
    }  # fmt: skip


def value_of(action: argparse.Action, things: dict[str, list[str]], rng: random.Random, out: Path) -> str:
    """A value for an argument: a sound one, another argument's, or none at all."""
    how = rng.random()
    if how < 0.1:
        return odd_word(rng)
    if how < 0.15:
        return rng.choice([value for values in things.values() for value in values])
    if action.dest == "set":
        declaration = rng.choice(PARAMETERS)
        name = rng.choice([name for name in limits_of(declaration) if name not in SLOW] + [odd_word(rng)])
        limits, kind = limits_of(declaration).get(name), types_of(declaration).get(name)
        ends = () if limits is None else (*(limits.choices or ()), str(limits.low), str(limits.high))
        text = rng.choice((*NUMBERS, *ends, "true", "false", "ball_seeking,approaching", "a,,b", str(kind)))
        return rng.choice((f"{name}={text}", f"{name}={text}", name, f"={text}"))
    if action.choices and how < 0.8:
        return str(rng.choice(list(action.choices)))
    if action.dest in things:
        return rng.choice(things[action.dest])
    if getattr(action.type, "__name__", "") in ("output_path", "Path"):
        return rng.choice((str(out), str(out / "x"), str(out) + "/", f"{out}.svg", "/proc/x", "/dev/null/x"))
    return rng.choice(NUMBERS)


def words_for(
    parser: argparse.ArgumentParser, things: dict[str, list[str]], rng: random.Random, out: Path
) -> list[str]:
    """Words that a parser takes, more or less: some of its arguments, in some order."""
    groups: list[list[str]] = []
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            name = rng.choice(list(action.choices))
            inner = words_for(action.choices[name], things, rng, out)
            groups.append([name, *inner] if rng.random() < 0.95 else [odd_word(rng)])
            continue
        if rng.random() > (0.95 if action.required or not action.option_strings else 0.25):
            continue
        count = {None: 1, "?": rng.randrange(2), "+": rng.randrange(1, 4), 0: 0}.get(action.nargs, 1)
        values = [value_of(action, things, rng, out) for _ in range(count)]
        if not action.option_strings:
            groups.append(values)
        elif count == 1 and rng.random() < 0.5:
            groups.append([f"{action.option_strings[-1]}={values[0]}"])
        else:
            groups.append([rng.choice(action.option_strings), *values])
    if rng.random() < 0.3:
        rng.shuffle(groups)
    words = [word for group in groups for word in group]
    if rng.random() < 0.15:
        words.insert(rng.randrange(len(words) + 1), rng.choice(("--", "-", "--x", "-x", "@x", "--json", odd_word(rng))))
    if words and rng.random() < 0.1:
        del words[rng.randrange(len(words))]
    return words


def judge(code: int, words: list[str], out: str, err: str) -> None:
    """What every command must fulfil."""
    assert code in (0, 1, 2, 3), words
    assert all(line.isprintable() for line in [*out.splitlines(), *err.splitlines()]), words
    assert "Traceback" not in err, words
    if code == 2:
        assert not out, words
        assert len([line for line in err.splitlines() if "warning" not in line]) >= 1, words
    elif "--json" in words and out and not {"-h", "--help"} & set(words):
        finite_json(out)


COMMANDS: dict[str, Callable[[list[str]], list[str]]] = {
    "compare": list,
    "demonstrate": lambda words: [
        *words,
        *([] if {"--keyboard"} & set(words) else ["--steps", "20", "--demonstrations", "2"]),
    ],
    "induce": lambda words: [*words, "--trials", "2", "--patterns", "50"],
    "lesson": list,
    "recover": list,
    "replay": lambda words: [*words, *([] if any(word.startswith("--set") for word in words) else ["--verify"])],
    "report": list,
    "train": lambda words: [*words, "--episodes", "1", "--max-steps", "5"],
    "tree": list,
    "tune": lambda words: [*words, "--episodes", "1", "--starts", "1"],
}
"""Commands, and what is typed last so that they are done soon."""


@pytest.mark.parametrize("name", COMMANDS)
def test_any_arguments_of_a_command_are_done_or_refused(things, tmp_path, monkeypatch, capsys, name):
    (tmp_path / "cwd").mkdir()
    monkeypatch.chdir(tmp_path / "cwd")  # ../x may be an output
    monkeypatch.setattr("fbql.cli.places.RUNS", tmp_path / "runs")
    monkeypatch.setattr("fbql.match.options.RUNS", tmp_path / "runs")
    parser = import_module(f"fbql.commands.{name}").parser(f"{name}.py")
    for number, rng in enumerate(dice(15)):
        words = COMMANDS[name](words_for(parser, things, rng, tmp_path / f"out{number}"))
        with bounded(LONGEST_COMMAND_S):
            code = getattr(commands, name)(words)
        judge(code, words, *capsys.readouterr())


def accept_or_refuse(take: Callable[[list[str]], object], words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Calls what takes words; what it refuses it must refuse in one printable line."""
    with bounded(LONGEST_COMMAND_S):
        try:
            take(words)
            code = 0
        except BadInput as error:
            assert str(error).isprintable()
            code = 2
        except SystemExit as end:
            code = end.code
    out, err = capsys.readouterr()
    assert code in (0, 2), words
    assert all(each.isprintable() for each in [*out.splitlines(), *err.splitlines()]), words


def test_any_arguments_of_bringup_are_a_match_or_refused(things, tmp_path, monkeypatch, capsys):
    """All that is refused before there is a process; nothing is started."""
    from fbql.commands import bringup

    def prepare(words: list[str]) -> None:
        with closing(LiveLine()) as line:
            bringup._prepare(bringup.parser("bringup.py").parse_args(words), line, Interrupts())

    (tmp_path / "cwd").mkdir()
    monkeypatch.chdir(tmp_path / "cwd")
    for number, rng in enumerate(dice(40)):
        words = words_for(bringup.parser("bringup.py"), things, rng, tmp_path / f"out{number}")
        words = [word for word in words if not word.startswith("--foxglove")]
        monkeypatch.setenv("ROS_DOMAIN_ID", rng.choice(("", "0", "232", "233", *NUMBERS[:-1])))
        accept_or_refuse(prepare, words, capsys)


def test_any_arguments_of_experiment_are_tasks_or_refused(things, tmp_path, capsys):
    from fbql_studies import experiment

    parser = experiment.parser("experiment.py")

    def tasks_of(words: list[str]) -> None:
        options = parser.parse_args(words)
        study_of(options.study).tasks(options)

    for number, rng in enumerate(dice(40)):
        words = words_for(parser, things, rng, tmp_path / f"out{number}")
        accept_or_refuse(tasks_of, words, capsys)
    assert set(STUDIES) <= set(parser._actions[1].choices)
