"""A match in words: its status while it is played, its result, and what to type next."""

from __future__ import annotations

import csv
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from fbql_common.core.text import as_lines

from fbql.cli.places import command_text
from fbql.cli.words import counted, percent


class Asked(NamedTuple):
    """How much was to be played, without guided episodes; 0: no limit. The limit that is reached first ends the match."""

    episodes: int = 0
    goals: int = 0

    def shortfall(self, episodes: int, goals: int) -> str:
        """How much of it was played, such as `9 of 40 episodes`; empty if all of it was."""
        if 0 < self.episodes <= episodes or 0 < self.goals <= goals:
            return ""
        parts = [f"{episodes} of {counted(self.episodes, 'episode')}"] if self.episodes else []
        parts += [f"{goals} of {counted(self.goals, 'goal')}"] if self.goals else []
        return " and ".join(parts)


def played_so_far(run: Path) -> tuple[int, int]:
    """The episodes that ended in a run directory, without guided ones, and the goals among them."""
    rows = [row for row in _rows(run / "episodes.csv") if row.get("phase") != "guided"]
    return len(rows), sum(row.get("outcome") == "goal" for row in rows)


def status_line(status: Mapping[str, str], width: int | None = None) -> str:
    """One line from the fields of a status (those of fbql_fusion.status), in the longest form that fits the width."""
    names, weights = status["weights"].split()[::2], status["weights"].split()[1::2]
    named = " ".join(f"{name} {weight}" for name, weight in zip(names, weights, strict=True))
    goals, own_goals, timeouts = status["goals"], status["own_goals"], status["timeouts"]
    episode, rate = f"episode {status['episode']}", f"{status['steps_per_s']} steps/s"
    score = f"{goals} goals, {own_goals} own goals, {timeouts} timeouts"
    long = f"{episode} ({status['phase']}) · step {status['step']} · {score} · {rate} · "
    short = f"{episode} · {score.replace('own goals', 'own')} · {rate} · "
    ends = (f"weights {named}", named, f"weights {' '.join(weights)}", " ".join(weights)) if weights else ("",)
    lines = [f"{start}{end}".removesuffix(" · ") for start, end in ((long, ends[0]), *((short, end) for end in ends))]
    return next((line for line in lines if width is None or len(line) <= width), lines[-1][:width])


def summary_text(
    summary: Mapping[str, Any],
    run: Path,
    dt_s: float,
    policy: tuple[str, str] | None = None,
    asked: Asked = Asked(),  # noqa: B008 - immutable
) -> str:
    """The summary as a newcomer reads it.

    Args:
        run: the run directory.
        dt_s: simulated time of one step [s].
        policy: the policy that the match started from, in one word and in a sentence; None for a controller that has
            none.
        asked: what was to be played.
    """
    episodes, goals, rate = summary["episodes"], summary["goals"], summary["success_rate"]
    success = "" if rate is None else f", success rate {percent(rate)}"
    mean, cost = summary["mean_steps_per_goal"], summary["cost_per_goal"]
    took = "no goal" if mean is None else f"steps on average, {mean * dt_s:.1f} s of play"
    cost_text = "no goal" if cost is None else "steps of all episodes, per goal"
    recorded = summary["messages_recorded"]
    rows: list[tuple[str, Any, str]] = [
        ("goals", goals, ""),
        ("own goals", summary["own_goals"], ""),
        ("timeouts", summary["timeouts"], "episodes that ended without a goal"),
        ("a goal took", _number(mean), took),
        ("a goal cost", _number(cost), cost_text),
        ("collisions", summary["collisions_begun"], f"with a wall, {summary['collision_steps']} steps in contact"),
        *([("policy", *policy)] if policy else []),
        *_guided(run / "episodes.csv"),
        ("played", summary["steps"], f"steps{_pace(summary, dt_s)}"),
        *_missed(summary),
        ("digest", summary["digest"][:8], "of every step; equal for identical lockstep matches"),
        ("recording", recorded or "none", f"{'messages' if recorded else 'the other files are'} in {run}"),
    ]
    if summary["incomplete"]:
        rows.append(("", "INCOMPLETE", f"some of the output could not be written; see {run / 'log'}"))
    title = f"{summary['controller']}, seed {summary['seed']}: "
    if shortfall := asked.shortfall(episodes, goals):
        title += f"ENDED EARLY after {shortfall}"
        if not asked.goals:  # else they are in it
            title += f", {counted(goals, 'goal')}"
    else:
        title += f"{counted(goals, 'goal')} in {counted(episodes, 'episode')}{success}"
    lines = [f"  {name:<11} {value!s:>9}  {meaning}".rstrip() for name, value, meaning in rows]
    return as_lines(["", title, "", *lines])


def _number(value: float | None) -> str:
    return "n/a" if value is None else f"{value:.0f}"


def _pace(summary: Mapping[str, Any], dt_s: float) -> str:
    """How fast it was; empty if that was not measured."""
    if not summary["wall_s"]:
        return ""
    rate = summary["steps_per_s"]
    return f" in {summary['wall_s']:.1f} s: {rate:.0f} steps/s, {rate * dt_s:.3g} times real time"


def _guided(episodes: Path) -> list[tuple[str, Any, str]]:
    """The row of the guided episodes, if there were any."""
    count = sum(row.get("phase") == "guided" for row in _rows(episodes))
    return [("guided", count, "episodes first; they count only in the lines below")] if count else []


def _missed(summary: Mapping[str, Any]) -> list[tuple[str, Any, str]]:
    """The rows of the steps that the simulator did not do in time, or fusion did not see, of a match in real time."""
    missed, unseen = summary.get("missed_ticks"), summary.get("steps_unseen")
    rows: list[tuple[str, Any, str]] = []
    if "missed_ticks" in summary and missed is None:
        rows.append(("missed", "n/a", "ticks: the simulator's count did not arrive"))
    elif missed is not None:
        in_words = "ticks of real time: the machine was too slow" if missed else "ticks: the simulator kept real time"
        rows.append(("missed", missed, in_words))
    if unseen:
        rows.append(
            ("unseen", unseen, "of these steps never reached fusion: they were driven without it, and are not recorded")
        )
    return rows


def _rows(episodes: Path) -> list[dict[str, str]]:
    """The rows of an episodes.csv; none where it can't be read."""
    try:
        with episodes.open(newline="") as file:
            return list(csv.DictReader(file))
    except OSError:
        return []


def export_text(domain_id: int) -> str:
    """What to type in another shell so that ROS tools there see the graph."""
    return f"export ROS_DOMAIN_ID={domain_id} ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"


def next_steps(
    summary: Mapping[str, Any],
    run: Path,
    same: str = "",
    learn: bool = True,
    controller: str = "",
    domain_id: int | None = None,
) -> str:
    """What to type next.

    Args:
        same: the options that give bringup the same behaviors, trees and parameters again.
        learn: whether the controller could keep learning.
        controller: the options that give it the same controller; by default its name.
        domain_id: the domain that the graph was in, if there was one.
    """
    bringup = f"{command_text('bringup')}{same}"
    player = bringup + (controller or f" --controller {summary['controller']}")
    place = shlex.quote(str(run))
    if (run / "policy.npz").is_file():
        player += f" --policy {shlex.quote(str(run / 'policy.npz'))}"
        other = (
            player,
            "continue from the learned policy" if learn else "continue learning from the policy that was played",
        )
        player += "" if learn else " --no-learn"
    elif summary["controller"] == "subsumption":
        shipped = not same  # the shipped policy fits the usual behaviors, trees and parameters
        meaning = "fused by the shipped policy" if shipped else "and fbql learns to fuse them"
        other = f"{bringup}{'' if shipped else ' --policy none'}", f"the same behaviors, {meaning}"
    else:
        other = f"{bringup} --controller subsumption", "the same behaviors, selected by priority instead"
    steps = [other, (f"{player} --realtime 1 --goals 3", "in real time for RViz or Foxglove, topic /simulator/markers")]
    if domain_id is not None:
        seen = "ros2 (here scripts/ros2), RViz and others see it; a run names its domain when it starts"
        meaning = f"in a second shell while it runs: {seen}"
        steps.append((export_text(domain_id), meaning))
    if summary["messages_recorded"]:
        steps.append((f"{command_text('report')} {place}", "a page that shows what happened, step by step, and why"))
    if summary["messages_recorded"] and summary["incomplete"]:
        steps.append((f"{command_text('recover')} {place}", "repair the recording, and see what was lost"))
    elif summary["messages_recorded"]:
        meaning = f"what was recorded, if ROS 2 is installed; Foxglove opens its {run.name}_0.mcap"
        steps.append((f"ros2 bag info {place}", meaning))
    steps.append(
        (
            f"{player} --watch terminal --goals 3",
            "watch it here, or with --watch browser on a page: who drives, and why",
        )
    )
    lines = [line for command, meaning in steps for line in (f"  {command}", f"      {meaning}")]
    return as_lines(["", "Next:", *lines])
