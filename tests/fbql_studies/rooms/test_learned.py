"""A mux in rooms: what it is told, whom it follows, and that a prior and a mask do what they say."""

from __future__ import annotations

from typing import Any

import pytest
from fbql_fusion.core.tasks.twist.parameters import MuxLearningParameters
from fbql_studies.rooms.learned import PENALTY, REWARD, Mux
from fbql_studies.rooms.maps import room_of
from fbql_studies.rooms.play import End, by_priorities
from fbql_studies.rooms.priorities import NAMES, TUNED, Gates
from fbql_studies.rooms.robot import MAX_STEPS, Reading
from fbql_studies.rooms.sources import SOURCES
from fbql_studies.rooms.worlds import TwinWorld

SETTING = TUNED["traps"]
ROOMS = [room_of("traps", seed) for seed in range(6)]


def mux(**changes: Any) -> Mux:
    gated = changes.pop("gated", False)
    values = {"behaviors": list(SOURCES), "seed": 3, "learn": True, "episodes": 0} | changes
    return Mux(MuxLearningParameters(**values), SETTING, gated=gated)


def test_an_episode_is_recorded_with_its_outcome_and_reward() -> None:
    played = mux()
    ends = [*played.play(TwinWorld(), ROOMS)]
    rewards = {"success": REWARD, "collision": PENALTY, "timeout": 0.0}
    assert {end.outcome for end in ends} > {"timeout"} or len({end.outcome for end in ends}) > 1
    for end, record in zip(ends, played.session.records, strict=True):
        assert (record.outcome, record.steps, record.return_) == (end.outcome, end.steps, rewards[end.outcome])
        assert not record.degraded
        assert end.cost == (end.steps if end.outcome == "success" else MAX_STEPS)


def test_the_same_seed_drives_the_same_way() -> None:
    assert [*mux().play(TwinWorld(), ROOMS)] == [*mux().play(TwinWorld(), ROOMS)]
    assert [*mux().play(TwinWorld(), ROOMS)] != [*mux(seed=4).play(TwinWorld(), ROOMS)]


def test_a_run_ends_after_its_episodes() -> None:
    assert len([*mux(episodes=2).play(TwinWorld(), ROOMS)]) == 2


def test_with_a_prior_and_no_experience_the_guide_drives() -> None:
    """At each step, as priorities do: decisions are held for one step, and patience is off."""
    frozen = mux(learn=False, fbql_prior=3.0, play_s=0.1, fbql_patience=0)
    assert [*frozen.play(TwinWorld(), ROOMS)] == [*by_priorities(SETTING, TwinWorld(), ROOMS)]


def test_a_source_whose_gate_is_closed_never_drives() -> None:
    gates, seen = Gates(SETTING), [0] * len(NAMES)

    def see(reading: Reading, driver: int) -> None:
        if reading.step == 0:
            gates.reset()
        open_now = gates.open(reading)
        if not (reading.terminated or reading.truncated):
            assert open_now[driver]
            seen[driver] += 1

    ends: list[End] = [*mux(gated=True).play(TwinWorld(), ROOMS, see)]
    assert len(ends) == len(ROOMS)
    assert sum(count > 0 for count in seen) > 1


@pytest.mark.parametrize("changes", [{"hold_s": 0.8}, {"hold_s": 0.4}])
def test_a_driver_is_held_while_it_is_learned(changes: dict[str, float]) -> None:
    drivers: list[int] = []
    [*mux(**changes).play(TwinWorld(), ROOMS[:1], lambda _, driver: drivers.append(driver))]
    steps = round(changes["hold_s"] / 0.1)
    blocks = [drivers[k : k + steps] for k in range(0, len(drivers) - 1, steps)]
    assert all(len(set(block)) == 1 for block in blocks)
    assert len(set(drivers)) > 1
