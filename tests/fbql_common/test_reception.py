"""When a message was received, by the clock that ages are measured with."""

from __future__ import annotations

import pytest
import rclpy
from fbql_common import reception
from fbql_common.reception import AgeClock
from rclpy.node import Node

S = 1_000_000_000


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch):
    """A clock by the steady time, and a system clock that a test sets."""
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Node("ages", context=context, use_global_arguments=False)
    wall = {"ahead_ns": 1000 * S}
    monkeypatch.setattr(reception, "monotonic_ns", lambda: 0)
    monkeypatch.setattr(reception, "time_ns", lambda: wall["now_ns"] + wall["ahead_ns"])
    wall["now_ns"] = 0
    made = AgeClock(node)

    def when_ns(received_ns: int, now_ns: int, ahead_ns: int) -> int:
        """When by the steady clock, if the system clock is now that much ahead of it."""
        wall.update(now_ns=now_ns, ahead_ns=ahead_ns)
        return made.when_ns(received_ns, now_ns)

    yield when_ns
    node.destroy_node()
    rclpy.try_shutdown(context=context)


def test_a_message_is_as_old_as_its_reception(clock) -> None:
    assert clock(1003 * S, 5 * S, 1000 * S) == 3 * S
    assert clock(0, 5 * S, 1000 * S) == 5 * S  # unknown


@pytest.mark.parametrize("set_to_s", [400, 1600], ids=["back", "forward"])
def test_a_system_clock_that_is_set_makes_no_waiting_message_new(clock, set_to_s: int) -> None:
    assert clock(1003 * S, 5 * S, set_to_s * S) <= 3 * S
    assert clock((set_to_s + 6) * S, 7 * S, set_to_s * S) == 6 * S  # and the next one counts as it is


def test_no_message_is_received_after_it_is_read(clock) -> None:
    assert clock(1009 * S, 5 * S, 1000 * S) == 5 * S
