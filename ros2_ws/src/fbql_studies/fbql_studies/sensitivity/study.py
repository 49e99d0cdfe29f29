"""Sensitivity: other values of fbql's parameters, and other guides, one change at a time or a few that go together."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fbql_studies.common import variants
from fbql_studies.common.methods import SENSED_CRITIC
from fbql_studies.common.training import Seeds, add_training_options
from fbql_studies.common.variants import Changes, Variants, changing
from fbql_studies.runner.study import Result

DESCRIPTION = (
    "fbql with other values of its parameters and other guides, each variant trained and played frozen like the default"
)
CAPTIONS = {
    "fusion_sensitivity": "What a goal costs with other values and guides, relative to the default on the same episodes, with 95 % intervals",
}
COLUMNS, words = variants.COLUMNS, variants.words
SEEDS = Seeds(1101, 3000)
"""The seeds that the defaults were chosen on; the ladder and the ablation evaluate on others."""


def _series(name: str, parameter: str, *values: Any) -> dict[str, Changes]:
    """A variant for each value of a parameter."""
    return {name.format(f"{value:g}"): {parameter: value} for value in values}


def _steps(name: str, parameter: str, *values: int) -> dict[str, Changes]:
    """The same for a duration in steps of 1/60 s."""
    return {name.format(value): {parameter: round(value / 60, 3)} for value in values}


VARIANTS = Variants(
    seeds=SEEDS,
    trained=changing(
        {
            **_steps("hold steps {}", "fbql_hold_s", 1, 2, 4, 8, 16),
            **_series("trace {}", "fbql_trace", 0.9, 0.95, 0.975),
            **_series("rate {}", "fbql_rate", 0.075, 0.15, 0.3),
            **_series("critic's rate {}", "fbql_value_rate", 0.01, 0.03, 0.1),
            **_series("clip {}", "fbql_clip", 0.2, 0.4, 1.0),
            **_series("collision {}", "fbql_reward_collision", 0.0, -0.2, -5.0),
            **_series("discount {}", "fbql_discount", 0.99, 0.998, 1.0),
            "paper's guide": {"preset": "paper"},
            "paper's guide, failures imitated": {"preset": "paper", "fbql_imitate_failures": True},
            "guided, but not followed": {"fbql_guide_passes": 0},
            "sensed critic, with rates and trace chosen for it": {
                **SENSED_CRITIC,
                "fbql_value_rate": 0.1,
                "fbql_trace": 0.975,
                "fbql_rate": 0.1,
            },
        }
    ),
    played=changing(_steps("play steps {}", "fbql_play_s", 1, 2, 4, 8)),
)
tasks, run, table = VARIANTS.tasks, VARIANTS.run, VARIANTS.table


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_training_options(parser, trees=2, seeds=2, episodes=1500, evaluate=200)


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """The cost of each variant, and the numbers it is drawn from (curves.json)."""
    from fbql_studies.sensitivity.figures import FIGURES

    return VARIANTS.figures(FIGURES, results, directory)
