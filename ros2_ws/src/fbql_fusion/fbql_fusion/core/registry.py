"""The controllers by name: those of this package, and those that a user registers.

    register_controller("greedy", Greedy)

`Greedy(parameters, generator)` returns a `Controller` or a `Learner` (`controllers.interface`). If it declares its own
parameters, `--set`, config.yaml and the fusion node accept them like all others.
"""

from __future__ import annotations

import dataclasses
import re
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import check, limits_of, types_of

from fbql_fusion.core.controllers.guarded import guard, guarded_call
from fbql_fusion.core.controllers.guided import Guided
from fbql_fusion.core.controllers.interface import Controller, Learner
from fbql_fusion.core.controllers.parameters import CONTROLLERS, MUX_CONTROLLERS, SessionParameters
from fbql_fusion.core.controllers.uniform import Uniform
from fbql_fusion.core.learners.dyna.learner import FbqlModel
from fbql_fusion.core.learners.dyna.parameters import FbqlModelParameters
from fbql_fusion.core.learners.literal.learner import FbqlLiteral
from fbql_fusion.core.learners.ppo.learner import Fbql
from fbql_fusion.core.learners.value.learner import FbqlValue
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.tasks.interface import Guide, Imagination, Task

Factory = Callable[[Any, np.random.Generator], Any]
"""(parameters, generator) -> a controller. The generator is seeded from the run's seed; use no other."""
_LEARNERS: dict[str, Callable[[Any, Task[Any, Any, Any], Guide, np.random.Generator], Learner]] = {
    "fbql": Fbql,
    "fbql_literal": lambda parameters, _task, _guide, generator: FbqlLiteral(parameters, generator),
    "fbql_model": Fbql,  # where nothing can be imagined
    "fbql_value": FbqlValue,
}
_OURS = (*_LEARNERS, "subsumption", "priorities", "uniform")
"""Subsumption and priorities are the guides of soccer and of a mux: the controller is the guide of the task."""
_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)


class _Registered(NamedTuple):
    factory: Factory
    parameters: type[Any] | None
    """The dataclass of its parameters, an instance of which is passed to the factory; None: the factory gets all of
    fusion's."""


_registered: dict[str, _Registered] = {}


def register_controller(name: str, factory: Factory, parameters: type[Any] | None = None) -> None:
    """Registers a controller under a name. A controller registered under this name before is replaced.

    Args:
        name: letters, digits and underscores.
        factory: creates it, such as a class.
        parameters: the declaration of its own parameters, a frozen dataclass of `parameter(...)` fields that inherits
            from `SessionParameters`; by default the attribute `Parameters` of the factory, if it has one.

    Raises:
        BadInput: a name, a factory or a declaration that can't be used.
    """
    where = f"controller '{name}'"
    if not _NAME.fullmatch(name):
        raise BadInput(f"{where}: use letters, digits and underscores for its name")
    if name in _OURS:
        raise BadInput(f"{where}: this package has a controller of that name; choose another")
    if not callable(factory):
        raise BadInput(f"{where}: a {type(factory).__name__} is not a class or a function (parameters, generator)")
    declaration = getattr(factory, "Parameters", None) if parameters is None else parameters
    if declaration is not None:
        _check_declaration(declaration, where)
    _registered[name] = _Registered(factory, declaration)
    for known in (CONTROLLERS, MUX_CONTROLLERS):
        if name not in known:
            known.append(name)


def fusion_parameters(controller: str) -> type[FusionParameters]:
    """`FusionParameters`, and with them the own parameters of this controller, if it is a registered one that has some."""
    declaration = _registered[controller].parameters if controller in _registered else None
    if declaration is None:
        return FusionParameters
    ours, kinds = limits_of(FusionParameters), types_of(declaration)
    own: list[tuple[str, Any, Any]] = []
    for field in dataclasses.fields(declaration):
        owners = ours[field.name].owners if field.name in ours else ()
        if field.name not in ours or owners:
            own.append((field.name, kinds[field.name], _owned(field, (*owners, controller))))
    return dataclasses.make_dataclass("FusionParameters", own, bases=(FusionParameters,), frozen=True)


def make_controller(
    parameters: SessionParameters,
    task: Task[Any, Any, Any],
    guide: Guide,
    imagination: Imagination | None = None,
) -> Controller:
    """The controller that the parameters name, with its own random stream from the run's seed.

    Args:
        imagination: of the task, for fbql_model; without one fbql takes its place.
    """
    name, n = parameters.controller, len(parameters.behaviors)
    generator = np.random.default_rng(np.random.SeedSequence(parameters.seed, spawn_key=(0,)))
    if imagination is not None and isinstance(parameters, FbqlModelParameters):
        return FbqlModel(parameters, task, guide, imagination, generator)
    if name in _LEARNERS:
        return _LEARNERS[name](parameters, task, guide, generator)
    if name in _OURS:
        return Uniform(n) if name == "uniform" else Guided(guide, n)
    return _make_registered(parameters, generator)


def _make_registered(parameters: SessionParameters, generator: np.random.Generator) -> Controller:
    name = parameters.controller
    factory, declaration = _registered[name]
    given: Any = parameters
    if declaration is not None:
        values = {field.name: getattr(parameters, field.name, None) for field in dataclasses.fields(declaration)}
        given = declaration(**{key: value for key, value in values.items() if hasattr(parameters, key)})
    file = source_file(name)
    made = guarded_call(factory, f"controller '{name}'", file, given, generator)
    return guard(made, name, file, len(parameters.behaviors))


def source_file(name: str) -> str:
    """The file of the module that defines a registered controller; "" for those of this package."""
    factory = _registered[name].factory if name in _registered else None
    return str(getattr(sys.modules.get(getattr(factory, "__module__", "")), "__file__", "") or "")


def is_ours(name: str) -> bool:
    """Whether a controller is one of this package."""
    return name in _OURS


def learns(parameters: SessionParameters) -> bool:
    """Whether the controller that the parameters name can learn."""
    if parameters.controller in _OURS:
        return parameters.controller in _LEARNERS
    return isinstance(_make_registered(parameters, np.random.default_rng(0)), Learner)


def _check_declaration(declaration: Any, where: str) -> None:
    """Raises BadInput if a declaration can't be added to fusion's parameters."""
    if not (isinstance(declaration, type) and dataclasses.is_dataclass(declaration)):
        raise BadInput(f"{where}: its Parameters must be a dataclass of parameter(...) fields")
    undeclared = [field.name for field in dataclasses.fields(declaration) if "limits" not in field.metadata]
    if undeclared:
        raise BadInput(f"{where}: declare its parameter '{undeclared[0]}' with parameter(...)")
    try:
        check(declaration(), where)
    except (TypeError, NameError) as error:
        raise BadInput(f"{where}: its Parameters can't be used ({error})") from None
    ours = limits_of(FusionParameters)
    for key, limits in limits_of(declaration).items():
        if key in ours and limits != ours[key]._replace(owners=limits.owners):
            raise BadInput(f"{where}: fusion has a parameter '{key}' already; choose another name")


def _owned(field: dataclasses.Field[Any], owners: tuple[str, ...]) -> Any:
    """A copy of a field with its owner."""
    metadata = {"limits": field.metadata["limits"]._replace(owners=owners)}
    if field.default_factory is not dataclasses.MISSING:
        return dataclasses.field(default_factory=field.default_factory, metadata=metadata)
    return dataclasses.field(default=field.default, metadata=metadata)
