"""metadata.yaml: what makes a directory with an MCAP file a bag (rosbag2's metadata, version 9, as Jazzy writes it)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import yaml
from fbql_common.core.errors import BadInput

from fbql_recording.plain_yaml import from_yaml

INFINITE_NS = 2**63 - 1
"""An infinite duration [ns], as DDS represents it."""


class Qos(NamedTuple):
    """The quality of service that a topic was offered with, in rosbag2's words."""

    history: str = "keep_last"
    depth: int = 10
    reliability: str = "reliable"
    durability: str = "volatile"
    deadline_ns: int = INFINITE_NS
    lifespan_ns: int = INFINITE_NS
    liveliness: str = "automatic"
    liveliness_lease_ns: int = INFINITE_NS


class BagTopic(NamedTuple):
    """One topic of a bag."""

    topic: str
    type_name: str
    type_hash: str
    qos_profiles: Sequence[Mapping[str, Any]]
    """The quality of service that each of its publishers offered."""
    messages: int


def qos_of(profile: Any) -> Qos:
    """The same as an rclpy QoSProfile. A duration of 0 means unspecified, hence infinite."""
    return Qos(
        profile.history.name.lower(),
        int(profile.depth),
        profile.reliability.name.lower(),
        profile.durability.name.lower(),
        profile.deadline.nanoseconds or INFINITE_NS,
        profile.lifespan.nanoseconds or INFINITE_NS,
        # SYSTEM_DEFAULT is automatic in every middleware of Jazzy.
        profile.liveliness.name.lower().replace("system_default", "automatic"),
        profile.liveliness_lease_duration.nanoseconds or INFINITE_NS,
    )


def qos_profiles(qos: Qos) -> list[dict[str, Any]]:
    """`offered_qos_profiles` with one profile."""
    return [
        {
            "history": qos.history,
            "depth": qos.depth,
            "reliability": qos.reliability,
            "durability": qos.durability,
            "deadline": _duration(qos.deadline_ns),
            "lifespan": _duration(qos.lifespan_ns),
            "liveliness": qos.liveliness,
            "liveliness_lease_duration": _duration(qos.liveliness_lease_ns),
            "avoid_ros_namespace_conventions": False,
        }
    ]


@lru_cache
def profiles_from_text(text: str) -> list[dict[str, Any]]:
    """`offered_qos_profiles` as a recording has it, policies in words (Jazzy) or numbers (before); empty if it is not
    one.

    They must otherwise stay unchanged: readers match a topic of the file to metadata.yaml by them.
    """
    try:
        profiles = from_yaml(text, "offered_qos_profiles") or []
        return [{name: _in_words(name, value) for name, value in profile.items()} for profile in profiles]
    except (BadInput, AttributeError, TypeError, IndexError):
        return []


def bag_information(
    file_name: str,
    topics: Sequence[BagTopic],
    start_ns: int,
    end_ns: int,
    custom_data: Mapping[str, str],
    ros_distro: str,
) -> dict[str, Any]:
    """rosbag2_bagfile_information of a bag with one MCAP file.

    Args:
        file_name: the MCAP file, relative to the directory.
        topics: every topic with its number of messages.
        start_ns: smallest log time [ns].
        end_ns: largest log time [ns].
        custom_data: about the recording.
        ros_distro: the distribution that recorded, "jazzy".
    """
    messages = sum(topic.messages for topic in topics)
    span = {
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "duration": {"nanoseconds": end_ns - start_ns},
        "message_count": messages,
    }
    return {
        "version": 9,
        "storage_identifier": "mcap",
        **span,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.topic,
                    "type": topic.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": list(topic.qos_profiles),
                    "type_description_hash": topic.type_hash,
                },
                "message_count": topic.messages,
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file_name],
        "files": [{"path": file_name, **span}],
        "custom_data": dict(custom_data) or None,
        "ros_distro": ros_distro,
    }


def to_yaml(value: Any) -> str:
    """YAML in the order given, without anchors."""
    return yaml.dump(value, Dumper=_NoAliases, sort_keys=False, allow_unicode=True, width=1000)


class _NoAliases(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):
    """No anchors: rosbag2 reads them, people don't. Written in C if PyYAML was built with it, which is ten times as
    fast."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


_WORDS = {
    "history": ("system_default", "keep_last", "keep_all", "unknown"),
    "reliability": ("system_default", "reliable", "best_effort", "unknown", "best_available"),
    "durability": ("system_default", "transient_local", "volatile", "unknown", "best_available"),
    "liveliness": ("system_default", "automatic", "manual_by_node", "manual_by_topic", "unknown", "best_available"),
}
"""The policies of a quality of service, in the order of their numbers in rmw."""


def _in_words(policy: str, value: Any) -> Any:
    """A policy in words; anything else is returned unchanged. Raises IndexError."""
    return _WORDS[policy][value] if policy in _WORDS and isinstance(value, int) else value


def _duration(nanoseconds: int) -> dict[str, int]:
    return {"sec": nanoseconds // 1_000_000_000, "nsec": nanoseconds % 1_000_000_000}
