"""A match on a screen: from its messages to the moment, its sentence and its page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from drawn_field import plain, world_with
from fbql.watch.match import match_page
from fbql.watch.moments import Moments
from fbql.watch.pace import Pace
from fbql.watch.words import why
from fbql_behaviors.core.explanation import rules
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.types import DRIVER_BLEND, BehaviorOutput, Decision, Phase, WheelCommand, World
from fbql_common.terminal.keys import Key
from fbql_common.wire import encode_command, encode_decision, encode_output, encode_world

BEHAVIORS = ("ball_seeking", "wall_avoiding", "approaching")
TREES = [load_tree(shipped_trees() / f"{name}.json") for name in BEHAVIORS]
STEP_NS = 16_666_667


def world_at(step: int, episode: int = 0, **fields: Any) -> World:
    world = world_with(x=-0.5 + 0.01 * step)
    return world._replace(stamp_ns=(1000 * episode + step + 1) * STEP_NS, episode=episode, step=step, **fields)


def tell(moments: Moments, world: World, decision: dict[str, Any] | None = None, place: str = "/") -> None:
    """Gives all the messages of a step, in the order in which they come."""
    at = world[:3]
    moments.hear(f"{place}world", encode_world(world))
    for name, tree in zip(BEHAVIORS, TREES, strict=True):
        output = BehaviorOutput(*at, name, 20.0, 20.0, 1, tree.leaf_count, tree.hash, False, (0.1,))
        moments.hear(f"{place}behaviors/{name}", encode_output(output))
    moments.hear(f"{place}wheel_command", encode_command(WheelCommand(*at, 80.0, 80.0)))
    usual: dict[str, Any] = {"weights": (0.0, 0.0, 1.0), "driver": 2, "learned_weights": (0.25, 0.125, 0.625)}
    made = Decision(*at, "fbql", Phase.LEARNING, BEHAVIORS, (1, 1, 1), (0.0,) * 3, degraded=False, reward=0.0, **usual)
    moments.hear(f"{place}fusion/decision", encode_decision(made._replace(**(decision or {}))))


def screen(
    moments: Moments, pace: Pace | None = None, size: tuple[int, int] = (80, 24), ascii_only: bool = False
) -> str:
    return "\n".join(plain(match_page(moments, pace, "the last line", *size, ascii_only)))


def moments_after(worlds: Sequence[World], decision: dict[str, Any] | None = None) -> Moments:
    moments = Moments(TREES)
    for world in worlds:
        tell(moments, world, decision)
    return moments


@pytest.mark.parametrize("size", [(80, 24), (120, 40), (66, 23)])
@pytest.mark.parametrize("ascii_only", [False, True])
def test_the_page_fits_and_shows_who_drives_why_and_the_keys(size: tuple[int, int], ascii_only: bool) -> None:
    pace = Pace(1.0, lambda: 0.0)
    text = screen(moments_after([world_at(step) for step in range(40)]), pace, size, ascii_only)
    lines = text.split("\n")
    assert len(lines) == size[1]
    assert max(map(len, lines)) <= size[0]
    assert text.isascii() or not ascii_only
    expected = [
        "fbql, learning",
        "episode 0",
        "0.7 s, step 39",
        "> approaching",
        "0.62",
        "0.25",
        "0.12",
        "+80.0  +80.0",
    ]
    expected += [
        "1 x real time",
        "pause",
        "one step",
        "faster, slower",
        "next episode",
        "stop watching",
        "the last line",
    ]
    assert [words for words in expected if words not in text] == []
    assert "approaching drives alone, because of its rule" in text


def test_nothing_has_come_yet_and_there_is_a_page() -> None:
    assert "the last line" in screen(Moments())


def test_the_sentence_names_the_rule_of_whoever_drives_alone() -> None:
    rule = rules(TREES[2])[1]
    assert why(moments_after([world_at(0)])) == (
        f"approaching drives alone, because of its rule: {rule.where} -> {rule.what}. So the command is: fast forwards."
    )
    guided = moments_after([world_at(0)], {"phase": Phase.GUIDED})
    assert "approaching drives alone (the guide's choice), because" in why(guided)


def test_the_sentence_of_a_blend_names_all_that_have_weight_the_heaviest_first() -> None:
    blend = {"driver": DRIVER_BLEND, "weights": (0.25, 0.0, 0.75), "learned_weights": ()}
    seeks, approaches = (rules(TREES[k])[1].what for k in (0, 2))
    assert why(moments_after([world_at(0)], blend)) == (
        f"They drive together: approaching 75 % ({approaches}) + ball_seeking 25 % ({seeks}). "
        "So the command is: fast forwards."
    )
    assert why(moments_after([world_at(0)], {**blend, "weights": (0.0,) * 3})).startswith("Nobody drives")


def test_without_its_tree_an_answer_has_no_rule_and_all_else_is_shown() -> None:
    moments = Moments()
    tell(moments, world_at(0))
    assert why(moments) == "approaching drives alone. So the command is: fast forwards."


def test_the_score_counts_outcomes_once_and_not_those_of_guided_episodes() -> None:
    goal, own = {"goal": True, "terminated": True}, {"own_goal": True, "terminated": True}
    moments = Moments(TREES)
    for episode, (ending, phase) in enumerate(
        [(goal, Phase.GUIDED), (goal, Phase.LEARNING), (own, Phase.LEARNING), ({"truncated": True}, Phase.LEARNING)]
    ):
        tell(moments, world_at(0, episode), {"phase": phase})
        for _ in range(3):  # a world state is published again until somebody answers
            tell(moments, world_at(60, episode, **ending), {"phase": phase})
    score = moments.score
    assert (score.goals, score.own_goals, score.timeouts) == (1, 1, 1)
    assert score.last == "episode 3: timeout after 1.0 s"
    assert why(moments) == "The episode ends here: timeout."


def test_the_trail_is_of_this_episode() -> None:
    moments = moments_after([world_at(step) for step in range(40)])
    assert len(list(moments.trail.robot)) == 10
    tell(moments, world_at(0, episode=1))
    assert len(list(moments.trail.robot)) == 1


def test_a_match_in_a_namespace_is_shown_and_other_messages_change_nothing() -> None:
    moments = Moments(TREES)
    tell(moments, world_at(3), place="/robot1/")
    moments.hear("/world", b"no world")
    moments.hear("/diagnostics", b"")
    assert "approaching drives alone" in why(moments)
    assert moments.seconds is None


def test_the_pace_is_told() -> None:
    pace = Pace(1.0, lambda: 0.0)
    told = []
    for key in (Key.FASTER, Key.PAUSE, Key.NEXT):
        pace.take(key)
        told.append(pace.words)
    assert told == ["2 x real time", "paused (2 x real time)", "on to the next"]
    assert "the match keeps its own time" in screen(moments_after([world_at(0)]), None)
