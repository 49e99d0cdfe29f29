"""When a recorded message is due, on a clock that is moved by hand."""

from __future__ import annotations

import pytest
from fbql.replay.pace import Order, Pace
from hypothesis import given
from hypothesis import strategies as st

NS = 1_000_000_000


class Time:
    """A clock that waiting moves, and orders that come at times of it."""

    def __init__(self, orders: dict[float, Order] | None = None) -> None:
        self.s = 100.0
        self._orders = sorted((orders or {}).items(), key=lambda item: item[0])

    def now(self) -> float:
        return self.s

    def orders(self, patience_s: float) -> list[Order]:
        until_s = self.s + patience_s
        if self._orders and 100.0 + self._orders[0][0] <= until_s:
            at_s, order = self._orders.pop(0)
            self.s = max(self.s, 100.0 + at_s)
            return [order]
        self.s = until_s
        return []


def played(times_s: list[float], rate: float = 1.0, orders: dict[float, Order] | None = None) -> list[float]:
    """When each message came out [s], of a recording with these times [s]."""
    time = Time(orders)
    pace = Pace(rate, time.now, time.orders)
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

    def orders(patience_s: float) -> list[Order]:
        asked_s.append(patience_s)
        return []

    pace = Pace(1.0, now, orders)
    assert all(pace.wait(number * NS // 3) for number in range(50))
    assert len(asked_s) > 100
    assert min(asked_s) >= 0.0


@given(st.lists(st.floats(0.0, 1e3), min_size=1, max_size=20))
def test_as_fast_as_it_goes_waits_for_nothing(times_s):
    assert played(times_s, rate=0.0) == [0.0] * len(times_s)


def test_a_pause_holds_everything_back_and_nothing_is_made_up_for():
    out = played([0.0, 1.0, 2.0, 3.0], orders={1.5: Order.PAUSE, 11.5: Order.PAUSE})
    assert out == pytest.approx([0.0, 1.0, 11.5, 12.5])


def test_a_step_is_all_that_has_the_next_time():
    orders = {0.2: Order.STEP, 5.0: Order.STEP, 7.0: Order.QUIT}
    assert played([0.0, 1.0, 1.0, 2.0, 2.0, 3.0], orders=orders) == pytest.approx([0.0, 0.2, 0.2, 5.0, 5.0])


def test_a_pause_in_the_middle_of_a_step_lets_the_step_be_whole():
    time = Time({0.05: Order.PAUSE, 4.0: Order.QUIT})
    pace = Pace(1.0, time.now, time.orders)
    assert pace.wait(0)
    time.s += 0.06
    assert pace.wait(0)
    assert pace.is_paused
    assert pace.wait(0)
    assert not pace.wait(NS)


def test_going_on_after_steps_goes_on_in_time():
    orders = {0.2: Order.STEP, 5.0: Order.PAUSE}
    assert played([0.0, 1.0, 2.0, 3.0], orders=orders) == pytest.approx([0.0, 0.2, 5.0, 6.0])


def test_time_that_goes_back_is_counted_and_not_waited_for():
    time = Time()
    pace = Pace(1.0, time.now, time.orders)
    assert [pace.wait(round(at * NS)) for at in (10.0, 11.0, 3.0, 4.0)] == [True] * 4
    assert time.s - 100.0 == pytest.approx(2.0)
    assert pace.went_back == 1


def test_a_recording_that_begins_again_has_not_gone_back():
    time = Time()
    pace = Pace(1.0, time.now, time.orders)
    pace.wait(10 * NS)
    pace.restart()
    pace.wait(0)
    assert (pace.went_back, time.s) == (0, 100.0)


def test_whoever_quits_is_obeyed_at_once_even_as_fast_as_it_goes():
    time = Time({0.5: Order.QUIT})
    pace = Pace(0.0, time.now, time.orders)
    assert pace.wait(0)
    time.s += 1.0
    assert not pace.wait(NS)
    assert pace.quit
