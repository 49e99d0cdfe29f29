"""The latest messages of a robot's topics as an observation, by the same rule for reading a bag and for driving with a tree.

The rule: at a moment, each number is that of its topic's last message, if that arrived at or before the moment and is no
older than the specification allows. Times are those at which messages were received (a bag's recording times), because the
stamps of different publishers may come from different clocks.
"""

from __future__ import annotations

from math import isfinite
from typing import Any, NamedTuple

from fbql_common.core.errors import BadInput

from fbql_behaviors.core.bag_spec import Reading, Spec, value_of

_NS = 1_000_000_000


class Observed(NamedTuple):
    """An observation, or why there is none."""

    values: tuple[float, ...]
    """One per feature; empty where there is a problem."""
    problem: str = ""


class Senses:
    """Remembers the last numbers of each topic."""

    def __init__(self, spec: Spec) -> None:
        self._spec = spec
        self._of_topic = {
            topic: tuple(reading for reading in spec.readings if reading.topic == topic) for topic in spec.topics
        }
        self._ages_ns = [(reading, round(reading.max_age_s * _NS)) for reading in spec.readings]
        self._heard_ns: dict[str, int] = {}
        self._values: dict[Reading, float] = {}

    def read(self, topic: str, message: Any) -> tuple[float, ...]:
        """The numbers of a topic's message, for `hear`. Raises BadInput naming the topic."""
        try:
            return tuple([reading.path.read(message, reading.inf_as) for reading in self._of_topic[topic]])
        except BadInput as error:
            raise BadInput(f"{topic}: {error}") from None

    def hear(self, topic: str, numbers: tuple[float, ...], now_ns: int) -> None:
        """Takes in the numbers of a message that was received at a time."""
        self._heard_ns[topic] = now_ns
        self._values.update(zip(self._of_topic[topic], numbers, strict=True))

    def observe(self, now_ns: int) -> Observed:
        """The observation at a time."""
        for reading, age_ns in self._ages_ns:
            heard_ns = self._heard_ns.get(reading.topic)
            if heard_ns is None:
                return Observed((), f"no message on {reading.topic} yet")
            if age_ns and now_ns - heard_ns > age_ns:
                return Observed((), f"{reading.topic} older than {reading.max_age_s:g} s")
        values = tuple([value_of(source, self._values) for source in self._spec.sources])
        for feature, value in zip(self._spec.features, values, strict=True):
            if not isfinite(value):
                return Observed((), f"{feature.name} not finite")
        return Observed(values)
