"""What a live page is told: each step once, in the form in which a report holds it, and all of it for a page opened late."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from fbql.watch import feed as feed_module
from fbql.watch.feed import Feed
from fbql.watch.pace import Pace
from fbql_behaviors.storage import load_tree
from fbql_common.core.topic_names import WORLD, behavior_topic
from fbql_common.core.types import World
from fbql_common.wire import decode_output, decode_world, encode_output, encode_world
from fbql_recording.core.packing import Packing, unpack
from fbql_recording.run import Run, open_run
from recorded_match import TREES, record_match

Told = dict[str, Any]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return open_run(record_match(tmp_path_factory.mktemp("run") / "run", episodes=3, max_steps=90))


def feed_of(run: Run) -> Feed:
    return Feed(run.recorded, [load_tree(TREES / f"{name}.json") for name in run.behaviors])


def told_while(run: Run, feed: Feed, every: int) -> Iterator[Told]:
    """What a page is told that is open all the time and looks after so many messages."""
    for number, message in enumerate(run.messages()):
        feed.hear(message.topic, message.data)
        if number % every == 0 and (news := feed.news(None)):
            yield json.loads(news)
    feed.settle()
    yield json.loads(feed.news(None) or "{}")


def columns_of(told: list[Told]) -> dict[str, Any]:
    """What a page has of all that it was told."""
    packings: list[Any] = []
    parts: list[dict[str, Any]] = []
    for each in told:
        packings = each.get("packings", packings)
        for rows, packing, data in each.get("blocks", ()):
            named = [Packing(*names) for names in packings[packing]]
            parts.append(unpack(base64.b64decode(data), named, rows))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


@pytest.mark.parametrize("every", [1, 7, 1000])
def test_every_step_is_told_once_as_it_was_recorded(run: Run, every: int) -> None:
    columns, recorded = columns_of(list(told_while(run, feed_of(run), every))), run.arrays()
    assert len(columns["step"]) == len(recorded["step"])
    for name in ("episode", "step", "driver", "goal"):
        assert np.array_equal(columns[name], recorded[name])
    for name in ("robot_x_m", "ball_y_m", "command_left_rad_s"):
        assert np.allclose(columns[name], recorded[name], atol=1e-4)
    assert np.allclose(columns["weights.1"], recorded["weights"][:, 1], atol=1e-4)


def test_episodes_words_and_the_score_are_told_as_they_change(run: Run) -> None:
    told = list(told_while(run, feed_of(run), 5))
    last: dict[int, Told] = {}
    for each in told:
        last |= {episode["first"]: episode for episode in each.get("episodes", ())}
    found = [(each["index"], each["count"], each["outcome"]) for each in last.values()]
    assert found == [(each.index, each.recorded_steps, each.outcome) for each in run.episodes()]
    assert sum("trees" in each for each in told) < len(told) / 2, "words are told when there is a new one"
    trees = next(each["trees"] for each in reversed(told) if "trees" in each)
    assert [len(tree["leaves"]) for tree in trees] == [load_tree(TREES / f"{n}.json").leaf_count for n in run.behaviors]
    assert next(each["tiles"] for each in reversed(told) if "tiles" in each)[0][0] == "3"


def test_a_page_that_is_opened_late_is_told_all_and_others_nothing_twice(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(feed_module, "_ARCHIVED", 50)
    feed = feed_of(run)
    early = list(told_while(run, feed, 11))
    late = json.loads(feed.all(None))
    assert feed.news(None) == ""
    whole, again = columns_of(early), columns_of([late])
    assert again.keys() == whole.keys()
    assert [name for name in again if not np.array_equal(again[name], whole[name], equal_nan=True)] == []
    assert [each["index"] for each in late["episodes"]] == [0, 1, 2]


def test_what_is_older_than_a_page_can_look_back_is_not_kept(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(feed_module, "_ARCHIVED", 40)
    monkeypatch.setattr(feed_module, "KEPT_STEPS", 100)
    feed = feed_of(run)
    list(told_while(run, feed, 11))
    late = json.loads(feed.all(None))
    steps = run.arrays()["step"]
    assert late["begin"] == 160 < len(steps)
    assert columns_of([late])["step"].tolist() == steps[160:].tolist()
    assert late["episodes"][0]["first"] + late["episodes"][0]["count"] > 160


def test_without_a_page_nothing_waits_to_be_told(run: Run) -> None:
    feed = feed_of(run)
    for message in run.messages():
        feed.hear(message.topic, message.data)
        feed.skip()
    assert feed.news(None).count("blocks") == 0
    assert sum(rows for rows, *_ in json.loads(feed.all(None))["blocks"]) == len(run.arrays()["step"])


def test_the_world_before_the_first_episode_is_no_episode(run: Run) -> None:
    """The simulator shows its world before a match begins, as episode -1, and behaviors answer."""
    first = next(message for message in run.messages() if message.topic == "/world")
    world: World = decode_world(first.data)
    feed = feed_of(run)
    early = world._replace(stamp_ns=world.stamp_ns - 1000, episode=-1)
    feed.hear(WORLD, encode_world(early))
    for name in run.behaviors:  # behaviors answer whatever they hear
        answer = next(each.data for each in run.messages([f"/{behavior_topic(name)}"]))
        feed.hear(
            behavior_topic(name), encode_output(decode_output(answer)._replace(stamp_ns=early.stamp_ns, episode=-1))
        )
    told = list(told_while(run, feed, 1000))
    assert sum(rows for each in told for rows, *_ in each.get("blocks", ())) == len(run.arrays()["step"])
    assert len(feed.contents.episodes) == 3


def test_a_replay_that_begins_again_is_told_again(run: Run) -> None:
    feed = feed_of(run)
    told = [*told_while(run, feed, 50), *told_while(run, feed, 50)]
    steps = run.arrays()["step"].tolist()
    assert columns_of(told)["step"].tolist() == [*steps, *steps]


def test_worlds_alone_are_told(run: Run) -> None:
    feed = feed_of(run)
    for message in run.messages(["/world"]):
        feed.hear(message.topic, message.data)
    feed.settle()
    assert sum(rows for rows, *_ in json.loads(feed.news(None))["blocks"]) == len(run.arrays()["step"])


def test_foreign_messages_change_nothing(run: Run) -> None:
    feed = feed_of(run)
    feed.hear("/world", b"no world")
    feed.hear("/elsewhere", b"")
    feed.settle()
    assert feed.contents.steps == 0


def test_the_pace_is_told_when_it_changes(run: Run) -> None:
    feed, pace = feed_of(run), Pace(1.0, lambda: 0.0)
    assert json.loads(feed.news(pace))["pace"] == {"rate": 1.0, "paused": False, "words": "1 x real time"}
    assert feed.news(pace) == ""
    pace.is_paused = True
    assert json.loads(feed.news(pace))["pace"]["paused"] is True
