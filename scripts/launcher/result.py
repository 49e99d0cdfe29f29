"""The result of a match in words."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any


def _share(value: float | None) -> str:
    return "n/a" if value is None else f"{100 * value:.0f} %"


def _steps(value: float | None) -> str:
    return "n/a" if value is None else f"{value:.0f} steps"


def summary_text(summary: Mapping[str, Any], run: Path, dt_s: float) -> str:
    """The summary as a newcomer reads it."""
    mean = summary["mean_steps_per_goal"]
    seconds = "" if mean is None else f" ({mean * dt_s:.1f} s of play)"
    lines = [
        "",
        f"Result of {summary['controller']}, seed {summary['seed']}: {summary['episodes']} episodes",
        f"  goals          {summary['goals']:>6}    success rate {_share(summary['success_rate'])}",
        f"  own goals      {summary['own_goals']:>6}",
        f"  timeouts       {summary['timeouts']:>6}",
        f"  a goal took    {_steps(mean):>12} on average{seconds}; all steps / goals: {_steps(summary['cost_per_goal'])}",
        f"  collisions     {summary['collisions_begun']:>6}    ({summary['collision_steps']} steps in contact with a wall)",
        f"  played         {summary['steps']:>6} steps in {summary['wall_s']:.1f} s: {summary['steps_per_s']:.0f} steps/s, "
        f"{summary['steps_per_s'] * dt_s:.0f}x real time",
        f"  digest         {summary['digest'][:16]}  (the same seed gives the same digest)",
        f"  recording      {run} ({summary['messages_recorded']} messages)",
    ]
    if summary["incomplete"]:
        lines.append("  THE RECORDING IS INCOMPLETE: see log/ in the run directory")
    return "\n".join(lines)


def next_steps(summary: Mapping[str, Any], run: Path) -> str:
    """What to type next."""
    other = "fbql_literal" if summary["controller"] == "subsumption" else "subsumption"
    return "\n".join(
        [
            "",
            "Next:",
            f"  python3 scripts/bringup.py --controller {other}     another way to fuse the same behaviors",
            "  python3 scripts/bringup.py --realtime 1 --goals 3     watch it in real time (RViz or Foxglove: /simulator/markers)",
            f"  ros2 bag info {run}     (or open the .mcap in Foxglove)",
        ]
    )
