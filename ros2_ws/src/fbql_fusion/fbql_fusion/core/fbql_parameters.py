"""The parameters of FBQL that learns (`controller` fbql): how it plays, what it tells apart and how it learns."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.parameters import parameter

PLAYS = ("held", "drawn", "blended")


@dataclass(frozen=True)
class FbqlParameters:
    """What `docs/fusion.md` calls eqs. 10 to 15. The defaults were chosen on training seeds and tree sets."""

    fbql_hold_steps: int = parameter(4, "steps for which fbql holds a decision while it learns", low=1, high=1000)
    fbql_play_steps: int = parameter(
        2, "steps for which fbql holds a decision when it does not learn", low=1, high=1000
    )
    fbql_play: str = parameter(
        "held",
        "how fbql plays when it does not learn: the behavior with the largest weight drives, one drawn by the weights, "
        "or all of them blended",
        choices=PLAYS,
    )
    fbql_patience: int = parameter(
        10,
        "decisions in the same joint state, in one episode, after which fbql that does not learn draws there instead of "
        "repeating itself, the longer by the more equal weights; 0: never",
        low=0,
        high=1_000_000,
    )
    fbql_reward_collision: float = parameter(
        -0.2, "reward of a collision for fbql, once when it begins", low=-1e9, high=1e9
    )

    fbql_leaf_pairs: bool = parameter(True, "whether each leaf, and each pair of leaves, is a feature")
    fbql_pair_tilings: int = parameter(4, "tilings of what each two behaviors sense", low=0, high=32)
    fbql_pair_tiles: int = parameter(6, "tiles along each component of such a tiling", low=1, high=64)
    fbql_joint_tilings: int = parameter(4, "tilings of what all behaviors sense together", low=0, high=32)
    fbql_joint_tiles: int = parameter(4, "tiles along each component of such a tiling", low=1, high=64)
    fbql_world_tilings: int = parameter(
        4,
        "tilings of where ball and robot are, and of the ball's velocity, that the critic of fbql goes by beside what is "
        "sensed; it is needed only to learn, no weight depends on them; 0: it knows only what the "
        "behaviors sense",
        low=0,
        high=32,
    )
    fbql_mirror: bool = parameter(True, "whether situations that mirror each other (left and right) share their tiles")

    fbql_discount: float = parameter(0.998, "gamma of fbql, per step", low=0.0, high=1.0)
    fbql_trace: float = parameter(0.95, "lambda of eq. 13, per decision", low=0.0, high=1.0)
    fbql_rate: float = parameter(0.15, "alpha of eq. 14, shared by the active features", low=0.0, high=10.0)
    fbql_value_rate: float = parameter(
        0.03, "beta of eq. 15, shared by all features that the critic goes by", low=0.0, high=2.0
    )
    fbql_clip: float = parameter(0.4, "change of a weight, in shares of it, beyond which eq. 14 leaves it", low=0.0)
    fbql_batch_episodes: int = parameter(
        20, "episodes learned from at a time, later on; it begins with 3", low=1, high=1000
    )
    fbql_passes: int = parameter(8, "passes over a batch", low=1, high=100)
    fbql_guide_passes: int = parameter(4, "passes over the guided episodes", low=0, high=1000)
    fbql_imitate_failures: bool = parameter(
        False, "whether guided episodes that did not end in a goal are imitated as well"
    )
    fbql_minibatch: int = parameter(128, "decisions that are learned from at once", low=1, high=100_000)
    fbql_divergence: float = parameter(
        0.05, "mean divergence of a batch's weights after which the passes leave them alone", low=0.0
    )
