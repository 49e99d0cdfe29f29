"""What a mux of velocity commands hears and publishes when it plays a policy. The fields are those of the messages, flat."""

from __future__ import annotations

from typing import NamedTuple


class MuxDecision(NamedTuple):
    """A decision and the snapshot that it was made on (fbql_msgs/MuxDecision); arrays in the order of `behaviors`."""

    stamp_ns: int
    episode: int
    step: int
    controller: str
    phase: int
    behaviors: tuple[str, ...]
    joint_state: tuple[int, ...]
    q: tuple[float, ...]
    weights: tuple[float, ...]
    driver: int
    reward: float
    degraded: bool
    learned_weights: tuple[float, ...]
    terminated: bool
    truncated: bool
    outcome: str
    observed: tuple[float, ...]
    active: tuple[bool, ...]
    commands: tuple[float, ...]
    ages_s: tuple[float, ...]
    overruled_by: str
    command: tuple[float, ...]


class RobotOutcome(NamedTuple):
    """What the robot achieved (fbql_msgs/Outcome)."""

    stamp_ns: int
    reward: float
    terminated: bool = False
    truncated: bool = False
    outcome: str = ""
