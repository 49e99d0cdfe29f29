"""FBQL from Python: behaviors learned from demonstrations, and a controller that learns to combine them.

    import fbql

    result = fbql.play(controller="subsumption", episodes=3, seed=31)
    result.summary["success_rate"]

play                  play a match in this process, without ROS; a `PlayResult`
train                 the same with a controller that learns; the result has a policy to save or to play
induce                demonstrations or patterns -> a decision tree; an `InductionResult`
open_run              read a recorded run
register_controller   add your own controller under a name
register_observation  add your own behavior: what it senses
BadInput              raised for input that can't be used, with one line: what is wrong, where, what to do

Nothing here needs ROS or matplotlib, and nothing is imported before it is used. The same things are commands: `fbql --help`.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # importing it would take most of the time in which a signal ends `fbql` with a traceback
if TYPE_CHECKING:
    from typing import Any

    from fbql_behaviors.core.observation import register as register_observation
    from fbql_common.core.errors import BadInput
    from fbql_fusion.core.registry import register_controller
    from fbql_recording.run import open_run

    from fbql.api import InductionResult, LearnedPolicy, PlayResult, induce, play, train

_HOMES = {
    "BadInput": "fbql_common.core.errors",
    "InductionResult": "fbql.api",
    "LearnedPolicy": "fbql.api",
    "PlayResult": "fbql.api",
    "induce": "fbql.api",
    "open_run": "fbql_recording.run",
    "play": "fbql.api",
    "register_controller": "fbql_fusion.core.registry",
    "register_observation": "fbql_behaviors.core.observation:register",
    "train": "fbql.api",
}
"""Name -> its module, or MODULE:NAME where it has another name there."""

__all__ = [
    "BadInput",
    "InductionResult",
    "LearnedPolicy",
    "PlayResult",
    "induce",
    "open_run",
    "play",
    "register_controller",
    "register_observation",
    "train",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'fbql' has no attribute '{name}'")
    module, _, other = _HOMES[name].partition(":")
    return getattr(import_module(module), other or name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
