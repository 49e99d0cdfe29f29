"""Ablation: what each part of fbql contributes. One part (once two) is removed, and the rest is trained and played
like the default."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from fbql_studies.common import variants
from fbql_studies.common.methods import SENSED_CRITIC
from fbql_studies.common.training import Seeds, add_training_options
from fbql_studies.common.variants import Variants, changing
from fbql_studies.runner.study import Result

DESCRIPTION = "fbql with one part removed at a time (once two), each variant trained and played frozen like the default"
CAPTIONS = {
    "fusion_ablation": "What a goal costs after one change, relative to the default on the same episodes, with 95 % intervals",
}
COLUMNS, words = variants.COLUMNS, variants.words
SEEDS = Seeds(1401, 9000)
"""Used for nothing else: on the seeds used to choose the parts, the default would look better than it is."""
VARIANTS = Variants(
    seeds=SEEDS,
    trained=changing(
        {
            "no leaves, no pairs of leaves": {"fbql_leaf_pairs": False},
            "no tilings of pairs": {"fbql_pair_tilings": 0},
            "no tilings of all": {"fbql_joint_tilings": 0},
            "leaves and pairs of leaves only": {"fbql_pair_tilings": 0, "fbql_joint_tilings": 0},
            "no mirror": {"fbql_mirror": False},
            "no critic": {"fbql_value_rate": 0.0, "fbql_trace": 1.0},
            "sensed critic": SENSED_CRITIC,
            "decided anew at each step": {"fbql_hold_s": 0.0},
            "no guided episodes": {"guided": 0},
            "collisions not punished": {"fbql_reward_collision": 0.0},
        }
    ),
    played=changing(
        {
            "no patience": {"fbql_patience": 0},
            "drawn play": {"fbql_play": "drawn"},
            "blended play": {"fbql_play": "blended"},
        }
    ),
)
tasks, run, table = VARIANTS.tasks, VARIANTS.run, VARIANTS.table


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_training_options(parser, trees=2, seeds=2, episodes=3000, evaluate=200)


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """The cost of each variant, and the numbers it is drawn from (curves.json)."""
    from fbql_studies.ablation.figures import FIGURES

    return VARIANTS.figures(FIGURES, results, directory)
