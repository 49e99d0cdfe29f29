"""A watchdog over the world states that a node receives."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.timer import Timer

from fbql_common.core.types import World
from fbql_common.inputs import Input
from fbql_common.wire import NS

PAUSED_AFTER_S = 2.0
AHEAD_NS = 60 * NS
"""A stamp this far ahead of the last one, without a pause between them, is from another clock."""
_PERIOD_S = 0.5


def steady_timer(node: Node, period_s: float, callback: Callable[[], None]) -> Timer:
    """A timer on the steady clock, independent of simulated and wall time (by default timers run on ROS time)."""
    return node.create_timer(period_s, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))


class WorldWatch:
    """Checks the order of world states; logs when none has arrived yet, when they pause, and when they resume.

    Owns: which world state counts as older. Does not own: the input.
    """

    def __init__(self, node: Node, world_input: Input[World]) -> None:
        self._node = node
        self._input = world_input
        self._last_ns = 0
        self._last_s = float("-inf")
        self._clock_ready = False
        self._waited = 0
        self._paused = False
        self._timer = steady_timer(node, _PERIOD_S, self._check)

    def accept(self, world: World) -> bool:
        """Whether a world state is usable: not older than the last one (those are counted), nor ahead of /clock.

        An episode's first world state is never too old, nor is any after a pause, because a restarted simulator begins
        its time anew.
        """
        if not self._clock_ready and self._waits_for_clock():
            self._input.drop("use_sim_time is set and no /clock has come yet")
            return False
        now = monotonic()
        if world.stamp_ns < self._last_ns and world.step != 0 and now - self._last_s < PAUSED_AFTER_S:
            self._input.drop(f"episode {world.episode}, step {world.step} is older than the last")
            return False
        if 0 < self._last_ns < world.stamp_ns - AHEAD_NS and now - self._last_s < PAUSED_AFTER_S:
            self._input.drop(f"its stamp is {(world.stamp_ns - self._last_ns) / NS:.0f} s ahead of the last")
            return False
        self._last_ns, self._last_s = world.stamp_ns, now
        return True

    def _waits_for_clock(self) -> bool:
        clock = self._node.get_clock()
        self._clock_ready = not clock.ros_time_is_active or clock.now().nanoseconds > 0
        return not self._clock_ready

    def _check(self) -> None:
        age_s = self._input.age_s()
        if age_s is None:
            if self._input.publishers() == 0:
                self._input.check_types()
                self._waited += 1
                if self._waited % 10 == 4:
                    self._node.get_logger().info(f"waiting for a simulator on {self._input.topic}")
            return
        paused = age_s > PAUSED_AFTER_S
        if paused and not self._paused:
            self._node.get_logger().warning(
                f"simulation paused: no world state on {self._input.topic} for {age_s:.1f} s"
            )
        if self._paused and not paused:
            self._node.get_logger().info("simulation resumed")
        self._paused = paused
