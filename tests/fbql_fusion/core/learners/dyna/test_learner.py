"""fbql_model on a task of two sides, with a learned model of it: when it imagines, what it learns from, what it keeps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.types import DRIVER_BLEND, Phase
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.session import Session
from fbql_fusion.core.soccer_session import SoccerSession, plays_instead
from held_learners import arrays_of, equal, learned
from imagined_sides import ImaginedSides, session_of
from two_sides import Answers, goals, parameters, play

GUIDED = 5


def given(**changes: Any) -> FusionParameters:
    """Parameters with which it imagines little, for this is a small task."""
    few = {"own_first_episodes": 240, "own_episodes": 90, "own_refit_episodes": 5, "guided": GUIDED, "seed": 1}
    return parameters("fbql_model", **(few | changes))


def begun(**changes: Any) -> tuple[Session[Any, Any, Any], ImaginedSides]:
    """A session, and what it imagines with."""
    imagination = ImaginedSides()
    return session_of(given(**changes), imagination), imagination


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_it_learns_from_imagined_episodes_what_its_guide_does_not_know(seed: int) -> None:
    """The guide drives up on either side, and scores in half of its episodes."""
    session, _ = begun(seed=seed)
    play(session, GUIDED + 40)
    assert goals(session, 40) >= 0.9
    only_guided, _ = begun(seed=seed, own_first_episodes=0, own_refit_episodes=0)
    play(only_guided, GUIDED + 40)
    assert goals(only_guided, 40) <= 0.7, "its twin that imagines nothing"


def test_it_imagines_after_the_guided_episodes_and_after_every_few_real_ones_a_batch_at_a_time() -> None:
    session, imagination = begun(own_batch_episodes=60)
    seen: list[tuple[int, list[int]]] = []
    for _ in range(GUIDED + 11):
        play(session, 1)
        seen.append((imagination.fits, list(imagination.episodes)))
        imagination.episodes.clear()
    first, later = (1, [60, 60, 60, 60]), [60, 30]
    assert seen[:GUIDED] == [(0, [])] * GUIDED
    assert seen[GUIDED:] == [first, *[(1, [])] * 4, (2, later), *[(2, [])] * 4, (3, later)]
    assert arrays_of(session)["counts"].tolist() == [11, 4 + 2 + 2], "real episodes, and an update for each batch"


def test_nothing_is_imagined_while_an_episode_is_played() -> None:
    session, imagination = begun(own_refit_episodes=1)
    for _ in range(GUIDED + 3):
        fits: list[int] = []

        def heard(_: object, answers: Answers, fits: list[int] = fits) -> Answers:
            fits.append(imagination.fits)
            return answers

        play(session, 1, heard)
        assert fits[0] == fits[-1] == imagination.fits


def test_what_is_due_when_the_run_ends_is_still_learned() -> None:
    session, imagination = begun(episodes=5)
    play(session, GUIDED + 5)
    before = arrays_of(session)
    assert session.next_episode() is None
    assert imagination.fits == 2
    assert not np.array_equal(arrays_of(session)["theta"], before["theta"])
    assert session.next_episode() is None
    assert imagination.fits == 2, "asked again, it does not learn again"


def test_a_frozen_session_imagines_nothing() -> None:
    session, _ = begun()
    play(session, GUIDED + 2)
    imagination = ImaginedSides()
    frozen = session_of(given(learn=False, guided=0), imagination, learned(session))
    play(frozen, 8)
    assert not imagination.fits
    assert equal(arrays_of(frozen), arrays_of(session))


def test_a_real_episode_teaches_the_model_alone() -> None:
    session, imagination = begun(own_refit_episodes=0)
    play(session, GUIDED + 1)
    before, steps = arrays_of(session), len(imagination)
    play(session, 6)
    after = arrays_of(session)
    assert len(imagination) > steps
    m = len(before["theta"])
    assert np.array_equal(after["theta"][:m], before["theta"])
    assert np.array_equal(after["value"][:m], before["value"])
    assert not after["theta"][m:].any()


def test_guided_episodes_also_teach_the_weights_to_follow_the_guide() -> None:
    """As with fbql, before anything is imagined, and after a policy was loaded. The guide always takes up."""
    session, imagination = begun(own_first_episodes=0, own_refit_episodes=0)
    play(session, GUIDED)
    session.next_episode()  # makes the features, and learns from the guided episodes
    policy = learned(session)
    assert not imagination.episodes, "nothing was imagined"
    assert policy.arrays["counts"].tolist() == [0, 0]
    up, down = policy.arrays["theta"].sum(axis=0)
    assert up > 0.1 > -0.1 > down, "up is preferred"
    assert policy.arrays["value"].any()
    again = session_of(given(own_first_episodes=0, own_refit_episodes=0, guided=3), ImaginedSides(), policy)
    play(again, 3)
    later = arrays_of(again)
    m = len(policy.arrays["theta"])
    assert (later["theta"][:m] - policy.arrays["theta"]).sum(axis=0)[0] > 0.01, "more so"
    assert later["counts"].tolist() == [0, 0]


def test_the_steps_are_those_of_all_episodes_or_of_the_guided_ones() -> None:
    for data, more in (("all", True), ("guided", False)):
        session, imagination = begun(own_data=data)
        play(session, GUIDED)
        steps = len(imagination)
        assert steps == session.steps - GUIDED + GUIDED
        play(session, 6)
        assert (len(imagination) > steps) is more
        assert len(imagination) == (session.steps if more else steps)
        assert imagination.fits == 2, "it imagines as often either way"


def test_reality_is_played_by_the_largest_weight_once_something_was_imagined() -> None:
    session, _ = begun(own_play_s=2 / 60, fbql_patience=0)
    play(session, GUIDED)
    decisions = play(session, 10)
    for decision in decisions:
        assert decision.phase == Phase.LEARNING
        assert decision.driver == int(np.argmax(decision.learned_weights))
        assert decision.weights == tuple(float(i == decision.driver) for i in range(2))
    assert {d.driver for d in decisions} == {0, 1}


def test_without_guided_episodes_behaviors_are_drawn_until_something_can_be_imagined() -> None:
    session, imagination = begun(guided=0, own_refit_episodes=0)
    first = play(session, 20)
    assert not imagination.fits
    assert {d.driver for d in first} == {0, 1}
    play(session, 1)
    assert imagination.fits == 1
    play(session, 39)
    assert goals(session, 40) >= 0.9


def test_the_step_after_a_missing_one_and_all_that_follow_are_no_data() -> None:
    session, imagination = begun()
    play(session, GUIDED)
    steps = len(imagination)

    def heard(world: Any, answers: Answers) -> Answers:
        return [answers[0], None] if world.step == 3 else answers

    play(session, 1, heard)
    assert len(imagination) == steps
    play(session, 1)
    assert len(imagination) > steps


def test_an_episode_that_begins_again_is_kept_from_its_new_start() -> None:
    session, imagination = begun(guided=0)
    play(session, 1)
    kept = imagination.to_arrays()["sides"]
    assert len(kept) == session.steps
    assert np.array_equal(kept[1:, :2], kept[:-1, 3:5]), "each step begins where the one before ended"


@pytest.mark.parametrize("after", [GUIDED + 1, GUIDED + 3, GUIDED + 5])
def test_a_run_that_is_continued_learns_exactly_what_one_without_a_break_learns(after: int) -> None:
    whole, _ = begun()
    play(whole, after)
    policy = learned(whole)
    imagination = ImaginedSides()
    again = session_of(given(guided=0, seed=77), imagination, policy)
    assert equal(arrays_of(again), dict(policy.arrays))
    worlds = play(whole, 12)
    again.skip_to_episode(after)  # the episodes' seeds are the run's
    again.parameters = replace(again.parameters, seed=1)
    continued = play(again, 12)
    assert [(d.weights, d.driver, d.learned_weights) for d in continued] == [
        (d.weights, d.driver, d.learned_weights) for d in worlds
    ]
    assert equal(arrays_of(again), arrays_of(whole))


def test_the_same_seed_learns_the_same_and_another_seed_another() -> None:
    runs: list[Any] = []
    for seed in (1, 1, 2):
        session, _ = begun(seed=seed)
        play(session, GUIDED + 12)
        runs.append((session.digest, arrays_of(session)))
    assert runs[0][0] == runs[1][0]
    assert equal(runs[0][1], runs[1][1])
    assert runs[0][0] != runs[2][0]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"imagined_at": None}, "imagined_at"),
        ({"imagined_at": np.array([99])}, "imagined_at"),
        ({"imagined_at": np.array([-2])}, "imagined_at"),
        ({"imagination_generator": None}, "imagination_generator"),
        ({"imagination_generator": np.zeros(6, dtype=np.uint64)}, "generator"),
        ({"sides": None}, "sides"),
    ],
)
def test_a_policy_that_can_not_be_is_refused(changes: dict[str, Any], words: str) -> None:
    session, _ = begun()
    play(session, GUIDED + 2)
    policy = learned(session)
    arrays = {name: array for name, array in {**policy.arrays, **changes}.items() if array is not None}
    with pytest.raises(BadInput, match=words):
        session_of(given(), ImaginedSides(), policy._replace(arrays=arrays))


def test_trees_other_than_those_that_answer_are_refused() -> None:
    session, imagination = begun()
    imagination.tree_hashes = ("hash of up", "another")
    with pytest.raises(BadInput, match="the tree of down that fbql_model would imagine with"):
        play(session, 1)


@pytest.mark.parametrize("guided", [0, 3])
def test_where_nothing_can_be_imagined_fbql_plays_and_one_line_says_so(guided: int) -> None:
    same = parameters("fbql_model", seed=2, guided=guided, fbql_hold_s=3 / 60, fbql_play_s=3 / 60)
    session = SoccerSession(same)
    play(session, 30)
    fbql = SoccerSession(parameters("fbql", seed=2, guided=guided))
    play(fbql, 30)
    assert session.digest == fbql.digest
    assert learned(session).kind == "fbql"
    assert equal(arrays_of(session), arrays_of(fbql))
    assert plays_instead(same, ()) == (
        "fbql_model can't imagine episodes, so fbql learns in its place: it does not know the trees of the behaviors"
    )


def test_a_guide_that_does_not_drive_is_no_reason_to_fail() -> None:
    session, imagination = begun(layers=["up"], guided=2)

    def heard(_: object, answers: Answers) -> Answers:
        return [answers[0], answers[1]]

    decisions = play(session, 3, heard)
    assert DRIVER_BLEND not in {d.driver for d in decisions}
    assert len(imagination)
