"""Assembles the messages of one step: the world state and every behavior's answer to it.

Messages arrive in any order, twice, late or not at all; a step is decided once, and only from its own messages.
Every message of a step carries its stamp.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

from fbql_common.core.types import BehaviorOutput, World

_MAX_STEPS = 16
"""Steps that are assembled at the same time; in lockstep there is one."""
MAX_GAP_S = 10.0
"""How far a world state may be ahead of the newest one before it [s]: one farther ahead does not belong to this episode."""
_MAX_GAP_NS = round(MAX_GAP_S * 1e9)
_LEAST_STEP_NS = 500_000
"""Steps that follow each other faster belong to no simulator, whose steps take 1 ms or more."""


class Arrival(Enum):
    """How a world state relates to the episode in progress."""

    NEW = "new"
    WAITING = "waiting"
    """It arrived before, and some behavior has not answered it yet."""
    DECIDED = "decided"
    """Its step was already decided: the command was lost, so repeat it."""
    FOREIGN = "foreign"
    """Of an older step, of one far ahead, of another episode, or of an episode whose beginning was missed."""


class PendingStep:
    """What has arrived for one step: decoded values and their bytes; None and b"" where nothing has arrived."""

    __slots__ = ("data", "outputs", "world", "world_data")

    def __init__(self, behaviors: int) -> None:
        self.world: World | None = None
        self.world_data = b""
        self.outputs: list[BehaviorOutput | None] = [None] * behaviors
        self.data = [b""] * behaviors


class StepAssembly:
    """Collects the messages of the steps that are not decided yet.

    Every behavior is waited for from the start until `drop_missing`, and again after its next timely answer.
    """

    def __init__(self, behaviors: Sequence[str]) -> None:
        self._names = tuple(behaviors)
        self._waited_for = [True] * len(self._names)
        self._episode: int | None = None
        self._anywhere = False
        self._decided: World | None = None
        self._newest_ns = 0
        """Stamp of the newest accepted world state of the episode, decided or not [ns]."""
        self._steps: dict[int, PendingStep] = {}

    def begin(self, episode: int, anywhere: bool = False) -> None:
        """An episode was requested: only its world states count from here on.

        They count from step 0 on, since an earlier run may have left the simulator in an episode of the same number;
        `anywhere`: from the first one that arrives, because step 0 was lost before.
        """
        self._episode = episode
        self._anywhere = anywhere
        self._decided = None
        self._newest_ns = 0
        self._steps.clear()

    def add_world(self, world: World, data: bytes) -> Arrival:
        """Adds a world state if it is new; returns how it relates to the episode."""
        decided = self._decided
        if world.episode != self._episode:
            return Arrival.FOREIGN
        if decided is None:
            if world.step != 0 and not self._anywhere and self.oldest() is None:
                return Arrival.FOREIGN
        elif world.stamp_ns <= decided.stamp_ns or world.step <= decided.step:
            return Arrival.DECIDED if world == decided else Arrival.FOREIGN
        elif (
            world.stamp_ns - self._newest_ns > _MAX_GAP_NS
            or (world.step - decided.step) * _LEAST_STEP_NS > world.stamp_ns - decided.stamp_ns
        ):
            return Arrival.FOREIGN
        step = self._step(world.stamp_ns)
        if step.world is not None:
            return Arrival.WAITING
        step.world, step.world_data = world, data
        self._newest_ns = max(self._newest_ns, world.stamp_ns)
        for index, output in enumerate(step.outputs):
            if output is not None and output.step != world.step:
                step.outputs[index], step.data[index] = None, b""
        return Arrival.NEW

    def add_output(self, index: int, output: BehaviorOutput, data: bytes) -> None:
        """Adds a behavior's answer. An answer to a step older than the last decided one is too late and is ignored."""
        decided = self._decided
        if output.episode != self._episode or (decided is not None and output.stamp_ns < decided.stamp_ns):
            return
        if decided is None or output.stamp_ns > decided.stamp_ns:
            step = self._step(output.stamp_ns)
            if step.world is not None and step.world.step != output.step:
                return
            step.outputs[index], step.data[index] = output, data
        self._waited_for[index] = True

    def oldest(self) -> PendingStep | None:
        """The oldest step that has its world state, if any is waiting."""
        return next((step for step in self._steps.values() if step.world is not None), None)

    def newest(self) -> PendingStep | None:
        """The newest step that has its world state, if any is waiting."""
        return next((step for step in reversed(self._steps.values()) if step.world is not None), None)

    def complete(self) -> PendingStep | None:
        """The newest step with its world state and the answer of every behavior that is waited for."""
        for step in reversed(self._steps.values()):
            if step.world is not None and (None not in step.outputs or self._is_complete(step)):
                return step
        return None

    def missing(self) -> list[str]:
        """Names of the behaviors that have not answered the oldest world state."""
        step = self.oldest()
        outputs = () if step is None else step.outputs
        return [self._names[index] for index, output in enumerate(outputs) if output is None]

    def drop_missing(self) -> list[str]:
        """Stops waiting for the behaviors that have not answered the oldest world state; returns their names."""
        dropped: list[str] = []
        missing = self.missing()
        for index, name in enumerate(self._names):
            if self._waited_for[index] and name in missing:
                self._waited_for[index] = False
                dropped.append(name)
        return dropped

    def decided(self, step: PendingStep) -> None:
        """Marks a step as decided, and drops those before it, by stamp or number: they are never decided."""
        world = step.world
        if world is None:
            raise ValueError("a step without a world state can't be decided")
        self._decided = world
        if len(self._steps) == 1:
            self._steps.clear()
        else:
            self._steps = {
                stamp: kept
                for stamp, kept in self._steps.items()
                if stamp > world.stamp_ns and (kept.world is None or kept.world.step > world.step)
            }

    def _step(self, stamp_ns: int) -> PendingStep:
        step = self._steps.get(stamp_ns)
        if step is None:
            if len(self._steps) == _MAX_STEPS:
                # An answer with a stamp of the future must not push out a step that is being played.
                without_world = [stamp for stamp, kept in self._steps.items() if kept.world is None]
                del self._steps[max(without_world) if without_world else next(iter(self._steps))]
            step = self._steps[stamp_ns] = PendingStep(len(self._names))
        return step

    def _is_complete(self, step: PendingStep) -> bool:
        """Whether the behaviors that are waited for, at least one, have answered."""
        return True in self._waited_for and not any(
            waited_for and output is None for waited_for, output in zip(self._waited_for, step.outputs, strict=True)
        )
