"""When a message is due, on a clock that is moved by hand."""

from __future__ import annotations

import pytest
from fbql.watch.pace import FASTEST, SLOWEST, Pace
from fbql_common.terminal.keys import Key
from hypothesis import given
from hypothesis import strategies as st

NS = 1_000_000_000


class Time:
    """A clock that waiting moves, and orders that come at times of it."""

    def __init__(self, orders: dict[float, Key] | None = None) -> None:
        self.s = 100.0
        self._orders = sorted((orders or {}).items(), key=lambda item: item[0])

    def now(self) -> float:
        return self.s

    def keys(self, patience_s: float) -> list[Key]:
        until_s = self.s + patience_s
        if self._orders and 100.0 + self._orders[0][0] <= until_s:
            at_s, order = self._orders.pop(0)
            self.s = max(self.s, 100.0 + at_s)
            return [order]
        self.s = until_s
        return []


def played(times_s: list[float], rate: float = 1.0, orders: dict[float, Key] | None = None) -> list[float]:
    """When each message came out [s], of a recording with these times [s]."""
    time = Time(orders)
    pace = Pace(rate, time.now, time.keys)
    out: list[float] = []
    for at_s in times_s:
        if not pace.wait(round(at_s * NS)):
            break
        out.append(time.s - 100.0)
    return out


@pytest.mark.parametrize("rate", [0.5, 1.0, 20.0])
def test_messages_come_out_when_they_are_due(rate):
    assert played([5.0, 5.5, 5.5, 9.0], rate) == pytest.approx([0.0, 0.5 / rate, 0.5 / rate, 4.0 / rate])


def test_nothing_is_ever_waited_for_less_than_no_time():
    """A message that comes due between two looks at the clock, however much of it passes there."""
    asked_s: list[float] = []
    time = Time()

    def now() -> float:
        time.s += 0.03
        return time.s

    def keys(patience_s: float) -> list[Key]:
        asked_s.append(patience_s)
        return []

    pace = Pace(1.0, now, keys)
    assert all(pace.wait(number * NS // 3) for number in range(50))
    assert len(asked_s) > 100
    assert min(asked_s) >= 0.0


@given(st.lists(st.floats(0.0, 1e3), min_size=1, max_size=20))
def test_as_fast_as_it_goes_waits_for_nothing(times_s):
    assert played(times_s, rate=0.0) == [0.0] * len(times_s)


def test_a_pause_holds_everything_back_and_nothing_is_made_up_for():
    out = played([0.0, 1.0, 2.0, 3.0], orders={1.5: Key.PAUSE, 11.5: Key.PAUSE})
    assert out == pytest.approx([0.0, 1.0, 11.5, 12.5])


def test_a_step_is_all_that_has_the_next_time():
    orders = {0.2: Key.STEP, 5.0: Key.STEP, 7.0: Key.FINISH}
    assert played([0.0, 1.0, 1.0, 2.0, 2.0, 3.0], orders=orders) == pytest.approx([0.0, 0.2, 0.2, 5.0, 5.0])


def test_a_pause_in_the_middle_of_a_step_lets_the_step_be_whole():
    time = Time({0.05: Key.PAUSE, 4.0: Key.FINISH})
    pace = Pace(1.0, time.now, time.keys)
    assert pace.wait(0)
    time.s += 0.06
    assert pace.wait(0)
    assert pace.is_paused
    assert pace.wait(0)
    assert not pace.wait(NS)


def test_going_on_after_steps_goes_on_in_time():
    orders = {0.2: Key.STEP, 5.0: Key.PAUSE}
    assert played([0.0, 1.0, 2.0, 3.0], orders=orders) == pytest.approx([0.0, 0.2, 5.0, 6.0])


def test_time_that_goes_back_is_counted_and_not_waited_for():
    time = Time()
    pace = Pace(1.0, time.now, time.keys)
    assert [pace.wait(round(at * NS)) for at in (10.0, 11.0, 3.0, 4.0)] == [True] * 4
    assert time.s - 100.0 == pytest.approx(2.0)
    assert pace.went_back == 1


def test_a_recording_that_begins_again_has_not_gone_back():
    time = Time()
    pace = Pace(1.0, time.now, time.keys)
    pace.wait(10 * NS)
    pace.restart()
    pace.wait(0)
    assert (pace.went_back, time.s) == (0, 100.0)


def test_whoever_quits_is_obeyed_at_once_even_as_fast_as_it_goes():
    time = Time({0.5: Key.FINISH})
    pace = Pace(0.0, time.now, time.keys)
    assert pace.wait(0)
    time.s += 1.0
    assert not pace.wait(NS)
    assert pace.quit


def test_faster_and_slower_change_what_is_left_to_wait_for():
    assert played([0.0, 4.0], orders={1.0: Key.FASTER}) == pytest.approx([0.0, 2.5])
    assert played([0.0, 4.0], orders={1.0: Key.SLOWER}) == pytest.approx([0.0, 7.0])


def test_beyond_the_fastest_rate_comes_as_fast_as_possible_and_back():
    pace = Pace(1.0, lambda: 0.0)
    rates: list[float] = []
    for key in [Key.FASTER] * 8 + [Key.SLOWER] * 12:
        pace.take(key)
        rates.append(pace.rate)
    assert rates[:8] == [2, 4, 8, 16, 32, FASTEST, 0, 0]
    assert rates[8:] == [FASTEST, 32, 16, 8, 4, 2, 1, 0.5, 0.25, 0.125, SLOWEST, SLOWEST]


@pytest.mark.parametrize("paused", [False, True])
def test_whoever_skips_is_at_the_next_episode_at_once_and_there_it_is_as_before(paused):
    time = Time()
    pace = Pace(1.0, time.now, time.keys)
    assert pace.ask(0)
    if paused:
        pace.take(Key.PAUSE)
    pace.take(Key.NEXT)
    assert [pace.ask(at * NS) for at in (1, 2, 3)] == [True] * 3
    pace.arrive()
    assert pace.ask(3 * NS), "the step that has begun is whole"
    assert not pace.ask(4 * NS)
    time.s += 1.0
    assert pace.ask(4 * NS) is not paused


def test_a_pause_ends_a_skip():
    pace = Pace(1.0, lambda: 0.0)
    pace.take(Key.NEXT)
    pace.take(Key.PAUSE)
    assert pace.is_paused
    assert not pace.ask(NS)


def test_lingering_delays_what_is_to_come():
    time = Time()
    pace = Pace(1.0, time.now, time.keys)
    pace.wait(0)
    pace.linger(3.0)
    assert pace.ask(0), "what has the time of the last message belongs to it"
    pace.wait(NS)
    assert time.s - 100.0 == pytest.approx(4.0)


def test_where_nothing_should_rush_lost_time_is_not_made_up_for():
    time = Time()
    pace = Pace(1.0, time.now, time.keys, catches_up=False)
    pace.wait(0)
    time.s += 10.0
    assert pace.ask(NS)
    assert not pace.ask(2 * NS)
    pace.wait(2 * NS)
    assert time.s - 100.0 == pytest.approx(11.0)
