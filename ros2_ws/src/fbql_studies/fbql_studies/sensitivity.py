"""What other values of FBQL's parameters, and other guides, come to: one change at a time, or a few that go together."""

from __future__ import annotations

import argparse
from typing import Any

from fbql_studies import fusion_words
from fbql_studies.methods import SENSED_CRITIC
from fbql_studies.training import Seeds
from fbql_studies.training import add_options as add_training_options
from fbql_studies.variants import Changes, Variants, changing

DESCRIPTION = (
    "fbql with other values of its parameters and other guides, each trained and played frozen like the default"
)
CAPTIONS = {
    "fusion_sensitivity": "What a goal costs with other values and guides, relative to the default on the same episodes, with 95 % intervals",
}
COLUMNS = fusion_words.COLUMNS
words = fusion_words.variant_tables
SEEDS = Seeds(1101, 3000)
"""Those that the defaults were chosen on; the ladder and the ablation use others, to judge by what was not seen."""


def _series(name: str, parameter: str, *values: Any) -> dict[str, Changes]:
    """A parameter with one value after the other."""
    return {name.format(f"{value:g}"): {parameter: value} for value in values}


VARIANTS = Variants(
    figure="sensitivity",
    seeds=SEEDS,
    trained=changing(
        {
            **_series("hold steps {}", "fbql_hold_steps", 1, 2, 4, 8, 16),
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
    played=changing(_series("play steps {}", "fbql_play_steps", 1, 2, 4, 8)),
)
tasks, run, table, figures = VARIANTS.tasks, VARIANTS.run, VARIANTS.table, VARIANTS.figures


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_training_options(parser, trees=2, seeds=2, episodes=1500, evaluate=200)
