"""A match that nobody watches does not ask behaviors whose answer nobody needs, and is the same match bit for bit."""

from __future__ import annotations

from collections import Counter
from typing import Any, ClassVar

import numpy as np
import pytest
from fbql.match.in_process import play
from fbql.match.trees import playing_trees
from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.types import BehaviorOutput, World
from fbql_fusion.core.learners.dyna import learner
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop
from studies import shipped

SHORT = SimulationParameters(max_steps=250)
IMAGINING = {
    "fbql_model_first_episodes": 3, "fbql_model_episodes": 2, "fbql_model_refit_episodes": 2, "imagined_max_steps": 30,
}  # fmt: skip


class Counting(Behavior):
    """A behavior that counts what it is asked."""

    asked: ClassVar[Counter[str]] = Counter()

    def answer(self, world: World) -> BehaviorOutput:
        self.asked[self.name] += 1
        return super().answer(world)


def played(watched: bool, **parameters: Any) -> SoccerSession:
    """A session that was played to its end."""
    behaviors = [Counting(each.name, each.tree) for each in shipped()]
    Counting.asked.clear()
    fusion = FusionParameters(seed=3, guided=2, episodes=5, **parameters)
    session = SoccerSession(fusion, trees=playing_trees(each.tree for each in behaviors))
    play(session, WorldLoop(SHORT), behaviors, lambda: True, (lambda *_: None) if watched else None)
    return session


@pytest.mark.parametrize(
    "parameters",
    [
        {"controller": "fbql"},
        {"controller": "fbql", "learn": False},
        {"controller": "fbql", "fbql_play": "blended", "learn": False},
        {"controller": "fbql_value"},
        {"controller": "fbql_literal"},
        {"controller": "subsumption"},
        {"controller": "fbql_model", **IMAGINING},
        {"controller": "fbql_model", "fbql_model_data": "guided", **IMAGINING},
    ],
    ids=lambda parameters: "-".join(map(str, list(parameters.values())[:3])),
)
def test_a_match_is_the_same_whether_it_is_watched_or_not(
    parameters: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(learner, "prepare", lambda: None)  # for so few imagined episodes compiling does not pay
    watched, unwatched = (played(each, **parameters) for each in (True, False))
    assert watched.digest == unwatched.digest
    assert watched.steps == unwatched.steps
    assert watched.records == unwatched.records
    policies = [session.policy() for session in (watched, unwatched)]
    if policies[0] is None or policies[1] is None:
        assert policies == [None, None]
        return
    assert policies[0].arrays.keys() == policies[1].arrays.keys()
    for name, array in policies[0].arrays.items():
        assert np.array_equal(array, policies[1].arrays[name]), name


def test_only_the_behavior_that_is_held_is_asked() -> None:
    session = played(watched=False, controller="fbql", fbql_hold_s=0.5)
    guided = sum(record.steps + 1 for record in session.records[: session.guided])
    free = sum(record.steps + 1 for record in session.records[session.guided :])
    asked = sum(Counting.asked.values()) - 3 * guided
    assert free < asked < 1.2 * free, "one of three, but for one step in thirty"
    played(watched=True, controller="fbql", fbql_hold_s=0.5)
    assert sum(Counting.asked.values()) == 3 * (guided + free)


def test_an_answer_that_can_not_be_used_is_decided_with_all_of_them() -> None:
    behaviors = shipped()
    session = SoccerSession(FusionParameters(controller="fbql", seed=1, guided=0, episodes=1))
    loop = WorldLoop(SHORT)
    begun = session.next_episode()
    assert begun is not None
    world = loop.reset(*begun)
    command, _ = session.decide(world, [each.answer(world) for each in behaviors])
    driver = session.held_driver
    assert driver >= 0
    world = loop.step(command.left_rad_s, command.right_rad_s)
    answer = behaviors[driver].answer(world)
    before = session.digest, session.steps
    for broken in (
        answer._replace(tree_hash="other"),
        answer._replace(leaf_id=answer.leaf_count),
        answer._replace(left_rad_s=float("nan")),
    ):
        assert session.hold(world, broken) is None
    for foreign in (
        world._replace(step=world.step + 1),
        world._replace(episode=world.episode + 1),
        world._replace(terminated=True),
        world._replace(truncated=True),
    ):
        assert session.hold(foreign, answer) is None
    assert (session.digest, session.steps) == before
    assert session.hold(world, answer) == (answer.left_rad_s, answer.right_rad_s)
    assert session.digest != before[0]
