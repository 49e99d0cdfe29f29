"""All parameters of fusion as one flat set of names, and which of them each controller uses."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import check, limits_of

from fbql_fusion.core.learners.dyna.parameters import FbqlModelParameters
from fbql_fusion.core.learners.literal.parameters import LiteralParameters
from fbql_fusion.core.learners.ppo.parameters import FbqlParameters
from fbql_fusion.core.learners.value.parameters import FbqlValueParameters
from fbql_fusion.core.tasks.soccer.subsumption import SubsumptionParameters
from fbql_fusion.core.tasks.soccer.world_model.parameters import WorldModelParameters

_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
GUIDE = "subsumption"
"""The controller that drives the guided episodes."""


@dataclass(frozen=True)
class FusionParameters(
    WorldModelParameters,
    FbqlModelParameters,
    FbqlValueParameters,
    FbqlParameters,
    LiteralParameters,
    SubsumptionParameters,
):
    """The parameters of the session, of Subsumption and of every learner. Each is declared by the part that uses it,
    and `Limits.owners` names these parts. `docs/deviations.md` lists which of them the paper leaves open."""

    @property
    def collision_reward(self) -> float:
        """The reward of a collision in force: a controller's own, NAME_reward_collision, or else the shared one."""
        return getattr(self, f"{self.controller}_reward_collision", self.reward_collision)


def check_fusion(parameters: FusionParameters, where: str) -> None:
    """Raises BadInput naming the first parameter that is wrong by itself or in combination with others."""
    check(parameters, where)
    names = parameters.behaviors
    if not names:
        raise BadInput(f"{where}: parameter 'behaviors' is empty; name at least one behavior")
    for name in names:
        if not _NAME.fullmatch(name):
            raise BadInput(
                f"{where}: parameter 'behaviors' has '{name}', which can't be a topic's name; "
                "use letters, digits and underscores"
            )
    for key, listed in (("behaviors", names), ("layers", parameters.layers)):
        twice = sorted({name for name in listed if listed.count(name) > 1})
        if twice:
            raise BadInput(f"{where}: parameter '{key}' names '{twice[0]}' twice; name it once")
    if parameters.weight_floor * len(names) > 1.0:
        raise BadInput(
            f"{where}: parameter 'weight_floor' is {parameters.weight_floor:g}; "
            f"{len(names)} behaviors leave at most {1 / len(names):g}"
        )
    known = {*names, *FusionParameters().layers}  # the default layers may stay when other behaviors are fused
    for name in parameters.layers:
        if name not in known:
            raise BadInput(
                f"{where}: parameter 'layers' has '{name}', which is not one of the behaviors ({', '.join(names)}); "
                "correct its spelling or remove it"
            )
    if not set(parameters.layers) & set(names):
        raise BadInput(
            f"{where}: parameter 'layers' ({', '.join(parameters.layers)}) names none of the behaviors "
            f"({', '.join(names)}); Subsumption, which also guides, has nothing to drive with"
        )


def unused_parameters(parameters: FusionParameters, given: Collection[str], guided: bool) -> Iterator[str]:
    """A line for each parameter that was given but has no effect with the controller in force.

    Args:
        given: names of parameters; those that are not fusion's are ignored.
        guided: whether there are guided episodes, in which Subsumption drives.
    """
    controller = parameters.controller
    every = limits_of(type(parameters))
    for name in given:
        if name not in every:
            continue
        owners = every[name].owners
        own = [f"{controller}_{stem}" for stem in _stems(name, owners) if f"{controller}_{stem}" in every]
        if not owners:
            if own and own[0] != name:
                yield f"{name} has no effect: the controller is {controller}, whose own is {own[0]}"
        elif controller not in owners and not (guided and GUIDE in owners):
            belongs = f"{name} has no effect: it belongs to {_all_of(owners)},"
            if GUIDE in owners:
                yield f"{belongs} the controller is {controller}, and no episode is guided"
            else:
                yield f"{belongs} and the controller is {controller}{f' (whose own is {own[0]})' if own else ''}"


def _all_of(names: Sequence[str]) -> str:
    """The names in one phrase: a, b and c."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def _stems(name: str, owners: Collection[str]) -> list[str]:
    """A parameter's name without its owner's name, and its full name."""
    return [*(name.removeprefix(f"{owner}_") for owner in owners if name.startswith(f"{owner}_")), name]
