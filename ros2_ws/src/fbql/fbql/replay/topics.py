"""Recorded topics as publishers: their message classes, and the quality of service that they were offered with."""

from __future__ import annotations

from copy import copy
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from fbql_common.core.errors import BadInput
from fbql_common.topics import STEP_QOS
from fbql_recording import Topic
from fbql_recording.bag_metadata import INFINITE_NS
from fbql_recording.message_definitions import essence, schema_text, type_hash
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy


def message_class(topic: Topic) -> type[Any]:
    """The message class of a recorded topic.

    Raises:
        BadInput: it is not installed, or installed with other fields than were recorded: then the recorded bytes would
            mean something else to whoever subscribes.
    """
    package, _, name = topic.type_name.split("/")
    try:
        if topic.message_encoding != "cdr":
            raise BadInput(f"{topic.name} is recorded as {topic.message_encoding}, not as cdr")
        found: type[Any] = getattr(import_module(f"{package}.msg"), name)
        if not _is_as_recorded(topic):
            raise BadInput(f"{topic.name}: {topic.type_name} was recorded with another definition than is installed")
    except (ImportError, AttributeError, PackageNotFoundError):
        raise BadInput(f"{topic.name}: message type {topic.type_name} is not installed here") from None
    return found


def qos_of(topic: Topic) -> QoSProfile:
    """The quality of service that a topic was offered with; that of our step topics where none is recorded.

    Raises:
        BadInput: what is recorded is no quality of service.
    """
    text = topic.metadata.get("offered_qos_profiles", "")
    try:
        profiles = yaml.safe_load(text)
        if not profiles:
            return copy(STEP_QOS)  # a profile can be changed, and this one is everybody's
        offered: dict[str, Any] = profiles[0]
        # `ros2 bag` can't know the history of others, and records "unknown" with depth 0.
        history = _policy(HistoryPolicy, offered["history"])
        is_known = history in (HistoryPolicy.KEEP_LAST, HistoryPolicy.KEEP_ALL)
        return QoSProfile(
            history=history if is_known else STEP_QOS.history,
            depth=max(int(offered["depth"]), 1) if is_known else STEP_QOS.depth,
            reliability=_policy(ReliabilityPolicy, offered["reliability"]),
            durability=_policy(DurabilityPolicy, offered["durability"]),
            deadline=_duration(offered["deadline"]),
            lifespan=_duration(offered["lifespan"]),
            liveliness=_policy(LivelinessPolicy, offered["liveliness"]),
            liveliness_lease_duration=_duration(offered["liveliness_lease_duration"]),
        )
    except (yaml.YAMLError, KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise BadInput(f"{topic.name}: the recorded quality of service can't be read ({error!r})") from None


def _is_as_recorded(topic: Topic) -> bool:
    recorded = topic.metadata.get("topic_type_hash")
    if recorded:
        return recorded == type_hash(topic.type_name, _share)
    return essence(topic.schema) == essence(schema_text(topic.type_name, _share))


def _share(package: str) -> Path:
    return Path(get_package_share_directory(package))


def _policy(kind: Any, value: Any) -> Any:
    """A policy in rosbag2's words (Jazzy) or numbers (before)."""
    return kind(value) if isinstance(value, int) else kind[str(value).upper()]


def _duration(value: dict[str, int]) -> Duration:
    nanoseconds = int(value["sec"]) * 1_000_000_000 + int(value["nsec"])
    # 0 is what rclpy calls a duration that nobody specified: infinite.
    return Duration(nanoseconds=0 if nanoseconds >= INFINITE_NS else nanoseconds)
