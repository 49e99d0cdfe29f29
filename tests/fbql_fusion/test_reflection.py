"""What is learned between two episodes while the node stays responsive: a thread, and the policy meanwhile."""

from __future__ import annotations

from threading import Event

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_fusion.reflection import Reflection
from held_learners import arrays_of, equal
from imagined_sides import ImaginedSides, session_of
from two_sides import parameters, play

FEW = {"own_first_episodes": 30, "own_batch_episodes": 10, "guided": 2, "seed": 1}


class Held(ImaginedSides):
    """Imagines nothing more until it is let go."""

    def __init__(self) -> None:
        super().__init__()
        self.has_begun, self.goes_on = Event(), Event()

    def play(self, *given):
        self.has_begun.set()
        assert self.goes_on.wait(60.0)
        return super().play(*given)


def test_it_takes_a_session_to_its_next_episode_and_until_then_the_policy_is_that_from_before() -> None:
    imagination = Held()
    session = session_of(parameters("fbql_model", **FEW), imagination)
    play(session, 2)
    before = arrays_of(session)
    assert session.reflects_next
    reflection = Reflection(session)
    assert imagination.has_begun.wait(60.0)
    assert reflection.is_under_way
    assert equal(arrays_of(session), before)
    imagination.goes_on.set()
    begun = reflection.next_episode()
    assert begun is not None
    assert begun[0] == 2
    assert not reflection.is_under_way
    after = arrays_of(session)
    assert "theta" in after
    assert "theta" not in before
    assert not session.reflects_next
    whole = session_of(parameters("fbql_model", **FEW), ImaginedSides())
    play(whole, 2)
    assert whole.next_episode() == begun
    assert np.array_equal(after["theta"], arrays_of(whole)["theta"]), "the same as without a thread"


def test_what_goes_wrong_in_it_is_raised_where_somebody_waits() -> None:
    class Failing(ImaginedSides):
        def fit(self, *_):
            raise BadInput("it can't be fitted")

    session = session_of(parameters("fbql_model", **FEW), Failing())
    play(session, 2)
    with pytest.raises(BadInput, match="can't be fitted"):
        Reflection(session).next_episode()
