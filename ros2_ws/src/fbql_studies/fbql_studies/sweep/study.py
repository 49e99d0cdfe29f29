"""A sweep: a match for every combination of values and every seed, and a row of the table for every combination."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from fbql.cli.controllers import add_controller_option
from fbql.cli.output import complain
from fbql.match.in_process import play_match, rehearse
from fbql.match.options import add_play_options, match_from, values_of_setting
from fbql.report.comparison import IQM, RunResult, groups_of, pairs_of
from fbql.statistics.tables import Row, Table, between, number, tabulate
from fbql_common.core.errors import BadInput
from fbql_common.core.types import Phase
from fbql_common.files import write_atomically
from fbql_fusion.controller_loading import resolve_controller

from fbql_studies.runner.study import MOST_SEEDS, Result, StudyTask, add_count, check_counts

DESCRIPTION = "controllers and parameters over several values, each with the same seeds"
CAPTIONS = {"sweep": "The results of each combination of values: each run, and all of them with their 95 % interval"}
SEEDS = 10
MOST_COMBINATIONS = 1000
_WORDS = {
    "success_rate": "goals / episodes",
    "cost_per_goal": "all steps of all episodes / goals",
    "own_goals_per_episode": "own goals / episodes",
    "collisions_per_episode": "collisions begun / episodes",
    IQM: "interquartile mean over runs of all steps / goals; a run without a goal costs all its steps",
}
COLUMNS = {
    "kind": "letter of the combination",
    "label": "controller, and the values in which the combinations differ",
    "runs": "number of seeds",
    **_WORDS,
    **{f"{name}_low": f"lower end of the 95 % interval of {name} over the runs" for name in _WORDS},
    **{f"{name}_high": f"upper end of the 95 % interval of {name} over the runs" for name in _WORDS},
    "cost_ratio": "cost_per_goal over that of the first combination, on the seeds that both have",
    "p": "p of the paired sign-flip test that both cost the same",
    "p_holm": "the same, adjusted by Holm for all combinations that are compared with the first",
    "improves": "probability that a run costs less than one of the first combination, equal ones by half",
    "improves_low": "lower end of its 95 % interval over the runs",
    "improves_high": "upper end of its 95 % interval over the runs",
}
_PLAYED = ("preset", "episodes", "goals", "guided", "max_steps", "learn")
_NAME_CHARACTERS = 100


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of what is swept and what is played."""
    swept = parser.add_argument_group("what is swept")
    add_count(swept, "--seeds", SEEDS, "seeds of each combination")
    swept.add_argument("--first-seed", type=int, default=0, metavar="S", help="the first of the seeds (0)")
    add_controller_option(
        swept, "a controller; may be repeated (fbql; with --preset alone, subsumption)", action="append", default=[]
    )
    swept.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE,...",
        help="a parameter of fusion or simulation (docs/parameters.md) and its values, such as fbql_hold_s=0.02,0.1,0.25; may be "
        "repeated: another parameter gives all combinations, the same one more values",
    )
    add_play_options(parser.add_argument_group("what is played"))


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """A match for every combination and seed; all combinations with one seed before the next, for an early look."""
    check_counts(options, seeds=MOST_SEEDS)
    matches = list(_matches(options))
    if len(matches) > MOST_COMBINATIONS:
        raise BadInput(f"that makes {len(matches)} combinations; at most {MOST_COMBINATIONS} are supported")
    notes: dict[str, None] = {}
    for each in matches:
        match = match_from(_arguments(each, options.first_seed))
        rehearse(match)
        notes |= dict.fromkeys(match.notes)
    for note in notes:
        complain(note)
    return [
        StudyTask(f"{number}-{_file_name(each)}-s{seed}", {"match": each, "seed": seed})
        for seed in range(options.first_seed, options.first_seed + options.seeds)
        for number, each in enumerate(matches, start=1)
    ]


def _matches(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """The options of a match for every combination, as JSON values: a task may be worked on elsewhere."""
    for name, option in (("seed", "--seeds and --first-seed"), ("controller", "--controller (it may be repeated)")):
        if any(setting.partition("=")[0] == name for setting in options.set):
            raise BadInput(f"--set {name}: use {option} instead")
    played = {name: getattr(options, name) for name in _PLAYED}
    played["trees"] = None if options.trees is None else str(options.trees.absolute())
    played["policy"] = options.policy if options.policy in (None, "none") else str(Path(options.policy).absolute())
    played["observation"] = [str(Path(each).absolute()) for each in options.observation]
    controllers = [resolve_controller(each).source or each for each in options.controller]
    for controller in dict.fromkeys(controllers) or (None,):
        values: dict[str, dict[str, None]] = {}
        for setting in options.set:
            found = values_of_setting(setting)
            values.setdefault(setting.partition("=")[0], {}).update(dict.fromkeys(found))
        for settings in product(*values.values()):
            yield {**played, "controller": controller, "set": list(settings)}


def _arguments(match: Mapping[str, Any], seed: int) -> argparse.Namespace:
    trees = match["trees"]
    return argparse.Namespace(**{**match, "trees": None if trees is None else Path(trees)}, seed=seed, out=None)


def _file_name(match: Mapping[str, Any]) -> str:
    """The distinguishing values of a combination, as a part of a file's name."""
    words = "-".join([Path(match["controller"] or "match").name, *match["set"]])
    return re.sub(r"[^\w.=-]", "_", words)[:_NAME_CHARACTERS]


def run(parameters: dict[str, Any]) -> Result:
    """Plays one match."""
    match, session, summary = play_match(match_from(_arguments(parameters["match"], parameters["seed"])), write=False)
    return {
        "seed": parameters["seed"],
        "setting": {
            "controller": match.fusion.controller,
            # Two files may have controllers of the same name.
            **({"controller_file": match.controller_file} if match.controller_file else {}),
            **dict(each.split("=", 1) for each in parameters["match"]["set"]),
        },
        "counts": {
            **{name: getattr(summary, name) for name in ("episodes", "goals", "own_goals", "timeouts")},
            "steps": sum(record.steps for record in session.records if record.phase is not Phase.GUIDED),
            "collisions": summary.collisions_begun,
            "contact_steps": summary.collision_steps,
        },
        "digest": summary.digest,
    }


def _runs(results: Mapping[str, Result]) -> list[RunResult]:
    return [
        RunResult(
            key, each["setting"]["controller"], each["seed"], each["setting"], each["counts"], each["digest"], True
        )
        for key, each in results.items()
    ]


def table(results: Mapping[str, Result]) -> list[Row]:
    """A row for each combination, in the order in which they were given."""
    groups, _ = groups_of(_runs(results))
    pairs = {pair.letter: pair for pair in pairs_of(groups)}
    return [
        {
            **group.row,
            "label": group.label,
            **{
                name: getattr(pairs[group.letter], name) if group.letter in pairs else None
                for name in ("cost_ratio", "p", "p_holm", "improves", "improves_low", "improves_high")
            },
        }
        for group in groups
    ]


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """The rows as people read them."""

    def told(measure: str, form: str):
        return lambda row: between(row, measure, f"{measure}_low", f"{measure}_high", form)

    columns = {
        "": lambda row: row["kind"],
        "combination": lambda row: row["label"],
        "runs": lambda row: str(row["runs"]),
        "success rate": told("success_rate", ".3f"),
        "steps per goal": told("cost_per_goal", ".0f"),
        "of the first's": lambda row: number(row["cost_ratio"], ".3f"),
        "p, by Holm": lambda row: number(row["p_holm"], ".3g"),
        "improves": told("improves", ".2f"),
        "IQM of steps per goal": told(IQM, ".0f"),
        "own goals per episode": told("own_goals_per_episode", ".3f"),
        "collisions per episode": told("collisions_per_episode", ".3f"),
    }
    return {"Each combination, with 95 % intervals over its runs": tabulate(rows, columns)}


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """Every run and every interval."""
    if not results:
        return []
    from fbql.report.comparison_figure import comparison_svg  # matplotlib takes a second, and is an extra

    groups, _ = groups_of(_runs(results))
    path = directory / "sweep.svg"
    write_atomically(path, comparison_svg(groups))
    return [path]
