"""A moment at which a mux decides: the snapshot of one tick."""

from __future__ import annotations

from typing import NamedTuple


class MuxMoment(NamedTuple):
    """See `core.tasks.interface.Moment`."""

    stamp_ns: int
    episode: int
    step: int
    observed: tuple[tuple[float, ...], ...]
    """What the robot senses, in groups: what belongs together, such as distance and bearing of a point. A group that is not known
    is empty."""
    reward: float = 0.0
    """Of the time since the moment before."""
    terminated: bool = False
    truncated: bool = False
    outcome: str = ""
    """How the episode ended; see `MuxTask.outcome`."""
    critic_inputs: tuple[float, ...] = ()
    """What only the critic is told, see `MuxTask`."""

    @property
    def ended(self) -> bool:
        """Whether the episode ended, for either reason."""
        return self.terminated or self.truncated
