"""The data that a live page is sent: the steps of a match as they arrive, in the form in which a report holds them."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterable
from typing import Any

from fbql_behaviors.core.tree import Tree
from fbql_common.core.topic_names import DECISION, WHEEL_COMMAND, WORLD, behavior_topic
from fbql_common.wire import Rejected, decode_command, decode_decision, decode_output, decode_world
from fbql_recording.core.columns import Recorded
from fbql_recording.core.episodes import Episode, episode_with
from fbql_recording.core.steps import Key, Step, StepData, StepJoin, key_of

from fbql.report.contents import PackedSteps, episode_data, packing_data, page_data, word_data
from fbql.report.page import tile_values
from fbql.watch.moments import TOPIC
from fbql.watch.pace import RATES, Pace

KEPT_STEPS = 100_000
"""How far back a newly opened page can look: half an hour of play. A page that stays open keeps up to twice as much."""
_ARCHIVED = 1024
"""Steps of a block that is kept for pages that are opened later."""


class Feed:
    """The steps so far, and those that pages have not been sent yet.

    Args:
        recorded: which messages a step has.
        trees: those that behaviors may answer with.
    """

    def __init__(self, recorded: Recorded, trees: Iterable[Tree] = ()) -> None:
        self.contents = PackedSteps(recorded, {tree.hash: tree for tree in trees})
        names = recorded.behaviors if recorded.outputs else ()
        topics = (WORLD, *map(behavior_topic, names), WHEEL_COMMAND, *([DECISION] if recorded.decision else []))
        self._places = {topic: place for place, topic in enumerate(topics)}
        self._outputs = len(names)
        self._join = StepJoin(len(topics))
        self._newest: Key = (-1, -1, -1)
        """Of the world state that came last."""
        self._new: list[Step] = []
        self._first_changed = 0
        """The first episode that pages have not been sent completely."""
        self._recent: list[Step] = []
        """Steps that are in no archived block yet."""
        self._archive: deque[tuple[int, int, str]] = deque()
        self._archived = self._begin = 0
        self._told: dict[str, Any] = {}
        self._known: list[int] = []
        """How many words of each kind pages have been sent."""

    def hear(self, topic: str, data: bytes) -> None:
        """Takes a message; those of other topics, and those that no node would act on, change nothing."""
        found = TOPIC.search(topic)
        place = None if found is None else self._places.get(found[1])
        key = None if place is None else key_of(data)
        if place is None or key is None:
            return
        if place == 0:
            if key < self._newest:  # a replay has begun again
                self.settle()
                self._join = StepJoin(len(self._places))
            self._newest = key
        self._join.add(place, key, data)
        for step in self._join.ready():
            self._take_data(step)

    def take(self, step: Step) -> None:
        """Takes a step."""
        contents = self.contents
        last = contents.episodes[-1] if contents.episodes else None
        episode = episode_with(last, contents.steps, step)
        if episode is not last:
            contents.episodes.append(episode)
        contents.steps += 1
        self._new.append(step)
        self._recent.append(step)
        if len(self._recent) == _ARCHIVED:
            self._archive.append(contents.packed(self._recent))
            self._archived += _ARCHIVED
            self._recent.clear()
            if self._archived > KEPT_STEPS:
                self._archived -= _ARCHIVED
                self._begin += self._archive.popleft()[0]

    def settle(self) -> None:
        """Takes the steps of which some messages did not arrive."""
        for step in self._join.rest():
            self._take_data(step)

    def data(self) -> dict[str, Any]:
        """The contents of the page before the first step."""
        return {**page_data(PackedSteps(self.contents.recorded), []), "rates": RATES, "kept": 2 * KEPT_STEPS}

    def all(self, pace: Pace | None) -> str:
        """The data for a page that has just been opened: everything that is kept. Call it after `news` or `skip`."""
        blocks = [*self._archive, *([self.contents.packed(self._recent)] if self._recent else [])]
        first = next((k for k, each in enumerate(self.contents.episodes) if self._end(each) > self._begin), 0)
        return json.dumps({"begin": self._begin, **self._state(pace), **self._words(), **self._steps(blocks, first)})

    def news(self, pace: Pace | None) -> str:
        """The data that pages have not been sent yet; empty if there is none."""
        state = self._state(pace)
        told = {name: value for name, value in state.items() if self._told.get(name, ()) != value}
        self._told = state
        if self._new:
            told |= self._steps([self.contents.packed(self._new)], self._first_changed)
            self._new.clear()
            self._first_changed = len(self.contents.episodes) - 1
        contents = self.contents
        known = [
            len(each) for each in (contents.controllers, contents.commands, contents.tree_hashes, contents.packings)
        ]
        if known != self._known:
            self._known = known
            told |= self._words()
        return json.dumps(told) if told else ""

    def skip(self) -> None:
        """Counts everything as sent: there is no page."""
        self._new.clear()
        self._first_changed = max(len(self.contents.episodes) - 1, 0)
        self._told, self._known = {}, []

    def _state(self, pace: Pace | None) -> dict[str, Any]:
        ended = [episode for episode in self.contents.episodes if episode.outcome is not None]
        how = None if pace is None else {"rate": pace.rate, "paused": pace.is_paused, "words": pace.words}
        return {"tiles": [(value, note) for _, value, note in tile_values(ended)], "pace": how}

    def _words(self) -> dict[str, Any]:
        return {**word_data(self.contents), "packings": packing_data(self.contents)}

    def _steps(self, blocks: list[tuple[int, int, str]], first: int) -> dict[str, Any]:
        """Blocks, and the episodes from one on."""
        return {"blocks": blocks, "episodes": [episode_data(each) for each in self.contents.episodes[first:]]}

    @staticmethod
    def _end(episode: Episode) -> int:
        return episode.first_step + episode.recorded_steps

    def _take_data(self, step: StepData) -> None:
        if step.episode < 0:
            return  # the simulator's world before the first episode
        world, *outputs, command = step.data[: self._outputs + 2]
        decision = step.data[self._outputs + 2] if len(step.data) > self._outputs + 2 else b""
        self.take(
            Step(
                step.stamp_ns,
                step.episode,
                step.step,
                _decoded(decode_world, world),
                tuple(_decoded(decode_output, each) for each in outputs),
                _decoded(decode_command, command),
                _decoded(decode_decision, decision),
            )
        )


def _decoded(decode: Any, data: bytes) -> Any:
    if not data:
        return None
    try:
        return decode(data)
    except Rejected:
        return None
