"""A moment at which a mux decides: the snapshot of one tick."""

from __future__ import annotations

from typing import NamedTuple


class MuxMoment(NamedTuple):
    """See `core.tasks.interface.Moment`."""

    stamp_ns: int
    episode: int
    step: int
    observed: tuple[tuple[float, ...], ...]
    """The observations, in groups that belong together, such as the distance and bearing of a point. An unknown group is empty."""
    reward: float = 0.0
    """Received since the moment before."""
    terminated: bool = False
    truncated: bool = False
    outcome: str = ""
    """How the episode ended; see `MuxTask.outcome`."""
    critic_inputs: tuple[float, ...] = ()
    """Inputs that only the critic sees, see `MuxTask`."""

    @property
    def ended(self) -> bool:
        """Whether the episode ended, for either reason."""
        return self.terminated or self.truncated
