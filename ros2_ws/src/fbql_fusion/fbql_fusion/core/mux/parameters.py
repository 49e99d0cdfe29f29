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
        "whether it sends geometry_msgs/TwistStamped instead of geometry_msgs/Twist; if not given: use_stamped",
    )
    guide_observation: str = parameter(
        "",
        "for a mux that learns: the priorities take this source only while this observation is within its limits; empty: always",
    )
    guide_low: float = parameter(-1e12, "lowest value of guide_observation", low=-1e12, high=1e12)
    guide_high: float = parameter(1e12, "highest value of guide_observation", low=-1e12, high=1e12)


@dataclass(frozen=True)
class ObservationParameters:
    """Parameters of an observation, observations.NAME."""

    topic: str = parameter("", "topic of the messages", required=True)
    type: str = parameter("", "their type, such as sensor_msgs/msg/LaserScan", required=True)
    field: str = parameter(
        "",
        "path of a number in them, such as ranges[0:24].min or pose.pose.orientation.yaw (docs/bags.md)",
        required=True,
    )
    low: float = parameter(
        0.0, "lowest value; lower ones, and -Inf, count as this", low=-1e12, high=1e12, required=True
    )
    high: float = parameter(
        0.0, "highest value; higher ones, and +Inf, count as this", low=-1e12, high=1e12, required=True
    )
    unit: str = parameter("", "unit of the value, for people")
    max_age_s: float = parameter(
        0.5, "an observation whose last message is older is unknown; 0: any age", unit="s", low=0.0, high=1e6
    )
    group: str = parameter(
        "",
        "observations in the same group share tiles, as the distance and bearing of a point should; empty: a group by itself",
    )


@dataclass(frozen=True)
class AxisParameters:
    """Parameters of an axis of the commands, axes.NAME, where NAME is linear_x, linear_y, linear_z, angular_x, angular_y or angular_z."""

    low: float = parameter(
        0.0,
        "lowest velocity; lower ones count as this, but are passed on unchanged",
        low=-1e6,
        high=1e6,
        required=True,
    )
    high: float = parameter(0.0, "highest velocity", low=-1e6, high=1e6, required=True)
    levels: int = parameter(5, "classes into which the mux divides the velocity that a source wants", low=2, high=100)


@dataclass(frozen=True)
class LearnedMuxParameters:
    """How a mux that learns is connected, and what it keeps."""

    policy: str = parameter("", "policy.npz to play, or to continue learning from; empty: none")
    safety_priority: int = parameter(
        100,
        "sources at or above this priority drive whenever they win, as in twist_mux; learning overrules neither them nor a lock",
        low=0,
        high=256,
    )
    reward_topic: str = parameter("reward", "topic of a std_msgs/Float64 that is added to the reward")
    segment_s: float = parameter(
        60.0,
        "where nobody publishes an Outcome, so that no episode ends: time after which an episode is cut off and learned from",
        unit="s",
        low=0.1,
        high=1e6,
    )
    record: bool = parameter(False, "whether decisions and commands are recorded to MCAP")
    run_directory: str = parameter(
        "",
        "directory of the run: a new one, or an existing one without a recording; empty: runs/TIME-CONTROLLER-sSEED in the working "
        "directory if something is learned or recorded",
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
