"""From the parameters of a mux node to its sources and locks, under the full names of their topics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from fbql_common.core.errors import BadInput
from fbql_common.core.mux_types import MuxDecision, RobotOutcome
from fbql_common.core.text import one_line
from fbql_common.core.topic_names import DECISION, MUX_OUTPUT, OUTCOME
from fbql_common.core.twist import StampedTwist, Twist
from fbql_common.declare import declare_all, declare_group
from fbql_common.wire import type_name
from rclpy.exceptions import NameValidationException
from rclpy.node import Node
from rclpy.validate_topic_name import validate_topic_name

from fbql_fusion.core.mux.config import HIGHEST, MuxConfig
from fbql_fusion.core.mux.learning import GROUPS, MuxDescription
from fbql_fusion.core.mux.parameters import (
    LearnedMuxParameters,
    LockParameters,
    MuxParameters,
    ObservationParameters,
    SourceParameters,
)
from fbql_fusion.core.tasks.twist.parameters import MuxLearningParameters


class MuxConfiguration(NamedTuple):
    """The configuration of a mux node."""

    description: MuxDescription
    config: MuxConfig
    stamped_output: bool
    stamped_sources: frozenset[str]
    """Names of the sources that send geometry_msgs/TwistStamped."""


def configure_mux(node: Node) -> MuxConfiguration:
    """Declares the parameters of a mux on its node, and reads them.

    Raises:
        BadInput: as declare_all and declare_group; no source; a topic with an invalid name, one that two sources share, or the
        mux's own output; a topic that would carry two types of messages.
    """
    where = node.get_fully_qualified_name()
    settings, learned, learning = declare_all(
        node, MuxParameters, LearnedMuxParameters, MuxLearningParameters, groups=GROUPS
    )
    topics = declare_group(node, "topics", SourceParameters, stamped=settings.use_stamped)
    others = {name: declare_group(node, name, kind) for name, kind in GROUPS.items() if name != "topics"}
    try:
        _check_topic("reward_topic", learned.reward_topic)
        named = {name: _resolve(node, name, others[name]) for name in ("locks", "observations")}
        mux = MuxDescription(settings, learned, learning, _resolve(node, "topics", topics), **(others | named))
        config = mux.config
        _refuse_a_loop(config, node.resolve_topic_name(MUX_OUTPUT))
        stamped = frozenset(name for name, source in topics.items() if source.stamped)
        _refuse_two_types(node, mux, stamped)
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    return MuxConfiguration(mux, config, settings.use_stamped, stamped)


def _resolve[P: (SourceParameters, LockParameters, ObservationParameters)](
    node: Node, prefix: str, entries: Mapping[str, P]
) -> dict[str, P]:
    found: dict[str, P] = {}
    for name, entry in entries.items():
        _check_topic(f"{prefix}.{name}.topic", entry.topic)
        found[name] = replace(entry, topic=node.resolve_topic_name(entry.topic))
    return found


def _check_topic(parameter: str, topic: str) -> None:
    try:
        validate_topic_name(topic)
    except NameValidationException as error:
        why = " ".join(str(error).rstrip("^ \n").split())
        raise BadInput(f"parameter '{parameter}': {why}") from None


def _refuse_a_loop(config: MuxConfig, output: str) -> None:
    for source in config.sources:
        if source.topic == output:
            raise BadInput(
                f"topics.{source.name} is {output}, on which the mux publishes; remap {MUX_OUTPUT} or let the source "
                "publish on another topic"
            )


def _refuse_two_types(node: Node, mux: MuxDescription, stamped: frozenset[str]) -> None:
    """The middleware can't make a subscription for a second type, and does not say why."""
    output = StampedTwist if mux.settings.use_stamped else Twist
    used = [
        (MUX_OUTPUT, node.resolve_topic_name(MUX_OUTPUT), type_name(output)),
        *(
            (f"topics.{name}", e.topic, type_name(StampedTwist if name in stamped else Twist))
            for name, e in mux.topics.items()
        ),
        *((f"locks.{name}", each.topic, type_name(bool)) for name, each in mux.locks.items()),
    ]
    if mux.is_learned:
        for name, topic, kind in (
            (DECISION, DECISION, MuxDecision),
            (OUTCOME, OUTCOME, RobotOutcome),
            ("reward_topic", mux.learned.reward_topic, float),
        ):
            used.append((name, node.resolve_topic_name(topic), type_name(kind)))
        used += [(f"observations.{name}", each.topic, each.type) for name, each in mux.observations.items()]
    first: dict[str, tuple[str, str]] = {}
    for what, topic, its_type in used:
        other, other_type = first.setdefault(topic, (what, its_type))
        if other_type != its_type:
            raise BadInput(
                f"{other} and {what} are both {topic}, the one with {other_type}, the other with {its_type}; give one of them "
                "another topic"
            )


def log_mux(node: Node, configuration: MuxConfiguration, output: str) -> None:
    """Logs the mux's configuration, and likely mistakes in its parameters."""
    config, logger = configuration.config, node.get_logger()
    kind = "TwistStamped" if configuration.stamped_output else "Twist"
    order = ", ".join(f"{source.name} ({source.priority})" for source in config.sources)
    locks = ", ".join(f"{lock.name} ({lock.priority})" for lock in config.locks) or "none"
    logger.info(one_line(f"{kind} on {output}; sources (priority): {order}; locks: {locks}"))
    for entry in (*config.sources, *config.locks):
        if not 0 <= entry.priority <= HIGHEST:
            logger.warning(one_line(f"{entry.name}: priority {entry.priority} is clamped to 0 to {HIGHEST}"))
    for source in config.sources:
        if source.priority <= 0:
            logger.warning(one_line(f"{source.name}: a source of priority 0 never drives"))
