"""The result of a run: which episodes count for what, and what the digest takes."""

from __future__ import annotations

import hashlib
import struct

from fbql_common.core.types import Phase, World
from fbql_recording.core.metrics import Digest, EpisodeRecord, step_bytes, summarise, summarise_task


def episode(phase: Phase, outcome: str, steps: int, begun: int = 0, contact: int = 0) -> EpisodeRecord:
    return EpisodeRecord(0, phase, 1, outcome, steps, begun, contact, 0.0, False)


def test_guided_episodes_count_towards_nothing_but_the_steps():
    records = [
        episode(Phase.GUIDED, "goal", 1000, 9, 90),
        episode(Phase.LEARNING, "goal", 100, 1, 5),
        episode(Phase.EVALUATION, "goal", 200, 2, 7),
        episode(Phase.LEARNING, "own_goal", 30, 0, 1),
        episode(Phase.LEARNING, "timeout", 400, 1, 0),
        episode(Phase.LEARNING, "timeout", 400),
    ]
    assert summarise("fbql", 7, records, 2500, "ab", 2.0, 3, True)._asdict() == {
        "controller": "fbql",
        "seed": 7,
        "episodes": 5,
        "goals": 2,
        "own_goals": 1,
        "timeouts": 2,
        "success_rate": 0.4,
        "cost_per_goal": 565.0,
        "mean_steps_per_goal": 150.0,
        "collisions_begun": 4,
        "collision_steps": 13,
        "steps": 2500,
        "wall_s": 2.0,
        "steps_per_s": 1250.0,
        "digest": "ab",
        "messages_recorded": 3,
        "incomplete": True,
    }


def test_in_another_task_every_word_but_success_and_timeout_is_a_failure():
    records = [
        episode(Phase.GUIDED, "success", 1000, 9, 90),
        episode(Phase.LEARNING, "success", 100, 1, 5),
        episode(Phase.EVALUATION, "success", 200, 2, 7),
        episode(Phase.LEARNING, "fell", 30),
        episode(Phase.LEARNING, "collision", 20, 1),
        episode(Phase.LEARNING, "timeout", 400),
    ]
    found = summarise_task("fbql", 7, records, 2500, "ab", 2.0, 3, True)
    assert found._asdict() == {
        "controller": "fbql",
        "seed": 7,
        "episodes": 5,
        "successes": 2,
        "failures": 2,
        "timeouts": 1,
        "success_rate": 0.4,
        "cost_per_success": 375.0,
        "mean_steps_per_success": 150.0,
        "collisions_begun": 4,
        "collision_steps": 12,
        "steps": 2500,
        "wall_s": 2.0,
        "steps_per_s": 1250.0,
        "digest": "ab",
        "messages_recorded": 3,
        "incomplete": True,
    }
    unknown = summarise_task("fbql", 7, [], 0, "ab")
    assert (unknown.success_rate, unknown.cost_per_success, unknown.mean_steps_per_success) == (None, None, None)
    assert (unknown.steps_per_s, unknown.messages_recorded, unknown.incomplete) == (None, 0, False)


def test_what_has_nothing_to_divide_by_is_none():
    summary = summarise("fbql", 1, [episode(Phase.GUIDED, "goal", 10)], 10, "")
    assert (summary.success_rate, summary.cost_per_goal, summary.mean_steps_per_goal) == (None, None, None)
    assert (summary.wall_s, summary.steps_per_s, summary.messages_recorded, summary.incomplete) == (
        None,
        None,
        0,
        False,
    )
    lost = summarise("fbql", 1, [episode(Phase.LEARNING, "timeout", 10)], 10, "")
    assert (lost.success_rate, lost.cost_per_goal, lost.mean_steps_per_goal) == (0.0, None, None)


def test_the_digest_is_of_all_bytes_in_order_and_more_can_be_added():
    digest = Digest()
    assert digest.hex == hashlib.sha256().hexdigest()
    digest.add(b"first")
    assert digest.hex == hashlib.sha256(b"first").hexdigest()
    digest.add(b"second")
    assert digest.hex == hashlib.sha256(b"firstsecond").hexdigest()


def test_a_step_of_soccer_adds_72_bytes_to_the_digest():
    world = World(1, 2, 3, 0.1, 0.2, 0.3, 8.0, 8.0, 0.4, 0.5, *[9.0] * 5, *[True] * 6)
    assert step_bytes(world, 6.0, 7.0) == struct.pack("<qq7d", 2, 3, 0.1, 0.2, 0.3, 0.4, 0.5, 6.0, 7.0)
