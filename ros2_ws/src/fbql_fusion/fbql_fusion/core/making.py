"""The controller that the parameters name."""

from __future__ import annotations

import numpy as np

from fbql_fusion.core.controllers import Controller, FbqlLiteral, Subsumption, Uniform
from fbql_fusion.core.fbql import Fbql
from fbql_fusion.core.fbql_value import FbqlValue
from fbql_fusion.core.parameters import FusionParameters

_LEARNERS = {"fbql": Fbql, "fbql_value": FbqlValue, "fbql_literal": FbqlLiteral}
LEARNERS = frozenset(_LEARNERS)
"""The controllers that learn, and start from a policy where they are given one."""


def make_controller(parameters: FusionParameters) -> Controller:
    """Makes it, with a random stream of its own from the run's seed."""
    if parameters.controller == "subsumption":
        return Subsumption(parameters)
    if parameters.controller == "uniform":
        return Uniform(parameters)
    return _LEARNERS[parameters.controller](
        parameters, np.random.default_rng(np.random.SeedSequence(parameters.seed, spawn_key=(0,)))
    )
