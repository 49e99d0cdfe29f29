"""What each part of FBQL is worth: without one (or two) of them, trained and played like the default."""

from __future__ import annotations

import argparse

from fbql_studies import fusion_words
from fbql_studies.methods import SENSED_CRITIC
from fbql_studies.training import Seeds
from fbql_studies.training import add_options as add_training_options
from fbql_studies.variants import Variants, changing

DESCRIPTION = "fbql without one of its parts at a time (once two), each trained and played frozen like the default"
CAPTIONS = {
    "fusion_ablation": "What a goal costs after one change, relative to the default on the same episodes, with 95 % intervals",
}
COLUMNS = fusion_words.COLUMNS
words = fusion_words.variant_tables
SEEDS = Seeds(1401, 9000)
"""Used for nothing else: on those that the parts were chosen on, the default would look better than it is."""
VARIANTS = Variants(
    figure="ablation",
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
            "decided anew at each step": {"fbql_hold_steps": 1},
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
tasks, run, table, figures = VARIANTS.tasks, VARIANTS.run, VARIANTS.table, VARIANTS.figures


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_training_options(parser, trees=2, seeds=2, episodes=3000, evaluate=200)
