"""The parameters that `fbql`, `fbql_model` and `fbql_value` share: how they distinguish situations, and how time is counted."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.parameters import owned_by, parameter

from fbql_fusion.core.controllers.parameters import SessionParameters

PLAYS = ("held", "drawn", "blended")
"""How a decision becomes weights while nothing is learned: see `fbql_play`."""

ROUNDED = ", rounded to whole steps, at least one"


@owned_by("fbql", "fbql_model", "fbql_value")
@dataclass(frozen=True)
class FeatureParameters(SessionParameters):
    """Parameters of the features, which `features` describes, and the unit of time of the discount."""

    fbql_leaf_pairs: bool = parameter(True, "whether each leaf, and each pair of leaves, is a feature")
    fbql_pair_tilings: int = parameter(4, "tilings of what each pair of behaviors senses", low=0, high=32)
    fbql_pair_tiles: int = parameter(6, "tiles along each component of such a tiling", low=1, high=64)
    fbql_joint_tilings: int = parameter(4, "tilings of what all behaviors sense together", low=0, high=32)
    fbql_joint_tiles: int = parameter(4, "tiles along each component of such a tiling", low=1, high=64)
    fbql_mirror: bool = parameter(True, "whether situations that mirror each other (left and right) share their tiles")
    fbql_discount_period_s: float = parameter(
        1.0 / 60.0, "time that gamma of fbql, fbql_model and fbql_value is stated for", unit="s", low=1e-6, high=1e6
    )
