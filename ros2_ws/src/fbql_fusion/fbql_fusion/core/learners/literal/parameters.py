"""The parameters of FBQL as printed (`controller` fbql_literal): those of eqs. 5 and 6, and their bounds."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.parameters import owned_by, parameter

from fbql_fusion.core.controllers.parameters import SessionParameters

TIE_RULES = ("none", "first", "all", "random")


@owned_by("fbql_literal")
@dataclass(frozen=True)
class LiteralParameters(SessionParameters):
    """The parameters of the paper's own update; see `docs/deviations.md`."""

    learning_rate: float = parameter(0.1, "alpha of eq. 5", low=0.0, high=1.0)
    discount: float = parameter(0.99, "gamma of eq. 5, per step", low=0.0, high=1.0)
    weight_gain: float = parameter(0.01, "delta of eq. 6", low=0.0, high=1e9)
    weight_offset: float = parameter(10.0, "f of eq. 6: keeps Q + f positive", low=-1e9, high=1e9)
    gain_low: float = parameter(0.0, "lower bound of delta (Q + f) in eq. 6; -1e9: as printed", low=-1e9, high=0.0)
    gain_high: float = parameter(1.0, "upper bound of delta (Q + f) in eq. 6; 1e9: as printed", low=0.0, high=1e9)
    weight_floor: float = parameter(
        0.01, "lower limit of each weight before normalization; -1e9: as printed", low=-1e9, high=1.0
    )
    tie_rule: str = parameter(
        "none",
        "which behavior is eq. 6's argmax if several share the largest Q: none of them, so that no weight changes; "
        "the first; all of them; or a random one",
        choices=TIE_RULES,
    )
    initial_q: float = parameter(0.0, "Q of a joint state that was never visited", low=-1e9, high=1e9)
