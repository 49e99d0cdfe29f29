"""The parameters of the mux: those of twist_mux, under its names, and the options that it lacks."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.parameters import parameter

NEVER, ONCE, REPEAT = "never", "once", "repeat"


@dataclass(frozen=True)
class MuxParameters:
    """Parameters of the whole mux."""

    use_stamped: bool = parameter(
        False, "whether sources and output are geometry_msgs/TwistStamped instead of geometry_msgs/Twist"
    )
    zero_when_locked: str = parameter(
        NEVER,
        "whether a zero command is published when a lock stops the source that drove last: once, or repeatedly until "
        "another source drives or the lock is off; twist_mux publishes nothing then",
        choices=(NEVER, ONCE, REPEAT),
    )
    zero_period_s: float = parameter(
        0.1, "time between the zero commands of zero_when_locked:=repeat", unit="s", low=0.01, high=10.0
    )


@dataclass(frozen=True)
class SourceParameters:
    """Parameters of a source, topics.NAME."""

    topic: str = parameter("", "topic of its velocity commands", required=True)
    timeout: float = parameter(
        0.0,
        "a source that has been silent for longer than this does not drive; 0: it never expires",
        unit="s",
        required=True,
    )
    priority: int = parameter(
        0,
        "the highest drives, among equals the first by name in alphabetical order; clamped to 0 to 255; a source "
        "of priority 0 never drives",
        required=True,
    )
    stamped: bool = parameter(
        False,
        "whether it sends geometry_msgs/TwistStamped instead of geometry_msgs/Twist; if not given, as use_stamped",
    )


@dataclass(frozen=True)
class LockParameters:
    """Parameters of a lock, locks.NAME."""

    topic: str = parameter("", "topic of its std_msgs/Bool: true turns it on, false off", required=True)
    timeout: float = parameter(
        0.0,
        "a lock that has been silent for longer than this is on; 0: it keeps its last state",
        unit="s",
        required=True,
    )
    priority: int = parameter(
        0, "while it is on, sources of a lower priority do not drive; clamped to 0 to 255", required=True
    )
