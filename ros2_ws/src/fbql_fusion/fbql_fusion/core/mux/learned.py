"""A mux whose choice among ordinary sources is learned. The rules of `Mux` still hold: the learner chooses only among the sources
that they leave, and never overrules one at or above `safety_priority`.

At each tick a decision is made on a snapshot of what is known then. The source that it names drives until the next tick: its commands
are passed on when they arrive, and the last one before the tick is passed on at the tick, if it has not been passed on yet. So each
command is passed on at most once, and only while its source may drive.

As in `Mux`, the caller passes the time; at a tick as a clock, because learning, which takes time, may come before a decision.
"""

from __future__ import annotations

from collections.abc import Callable
from math import nan
from typing import NamedTuple

from fbql_common.core.mux_types import MuxDecision, RobotOutcome
from fbql_common.core.twist import Twist

from fbql_fusion.core.mux.config import rank
from fbql_fusion.core.mux.mux import Mux
from fbql_fusion.core.mux.robot import Robot
from fbql_fusion.core.mux.snapshot import Snapshot
from fbql_fusion.core.mux_session import MuxSession
from fbql_fusion.core.tasks.twist.answers import SourceLeaves

SILENT_NS = 1_000_000_000
"""In a mux that learns, a source without a timeout counts as silent after this [ns]."""
KNOWN_LOOKS = 2
"""A node that publishes outcomes is known when it was there at so many looks in a row. One that says something once and goes, as a
person's command line does, is none that is missed."""
_NS = 1e9

Clock = Callable[[], tuple[int, int]]
"""Tells the time by the clock that ages are measured with, and the stamp of a decision made now [ns]."""


class Ticked(NamedTuple):
    """The decision of a tick, and what to publish because of it."""

    decision: MuxDecision
    pass_on: int | None = None
    """The source whose last command is passed on now, if there is one."""
    send: Twist | None = None
    """A command to send: a blend, or 0 because an episode ended."""


class LearnedMux:
    """Lets a session choose the source that drives.

    Args:
        mux: knows the sources and locks, and their rules.
        session: decides; its behaviors name the sources that it chooses among.
        robot: its axes and observations.
        safety_priority: sources at or above it drive by the rules of `Mux` alone.
        segment_s: see `LearnedMuxParameters`.
    """

    def __init__(self, mux: Mux, session: MuxSession, robot: Robot, safety_priority: int, segment_s: float) -> None:
        self._mux = mux
        self._session = session
        self._robot = robot
        self._safety = safety_priority
        self._leaves = SourceLeaves(robot.space)
        names = [source.name for source in mux.config.sources]
        self._sources = [names.index(name) for name in session.behaviors]
        """Place in the mux of each source that may be chosen."""
        self._never_expires = [source.timeout_s <= 0 for source in mux.config.sources]
        self._chosen: int | None = None
        """Place in the mux of the source that drives until the next tick."""
        self._blends = False
        """Whether the last tick sent a blend."""
        self._fresh = [False] * len(names)
        """Whether the last command of a source has not been passed on."""
        self._values = [nan] * len(robot.observations)
        self._heard_ns = [0] * len(robot.observations)
        self._outcomes: list[RobotOutcome] = []
        self._segment_ns = round(segment_s * _NS)
        self._begun_ns = 0
        self._episode = -1
        self._step = -1
        self._looks = 0
        """Looks in a row at which somebody published outcomes."""
        self._has_rewards = False
        """Whether somebody publishes rewards alone."""
        self._misses = False
        """Whether something that was achieved in this episode may not have been told, and that is not noted yet."""
        self._ends_now = False
        """Whether the episode is cut off at the next tick."""
        self.has_episodes = False
        """Whether somebody publishes when episodes end; otherwise they are cut off after segment_s."""
        self.is_lost = False
        """Whether those who published outcomes have gone."""
        self.is_done = False
        """Whether all episodes that were asked for have been played: there are no further decisions."""

    @property
    def session(self) -> MuxSession:
        """The session that decides."""
        return self._session

    def hear(self, index: int, command: Twist, now_ns: int, received_ns: int | None = None) -> bool:
        """Takes a command of source `index`, received at `received_ns`, or now. Returns whether to pass it on."""
        mux = self._mux
        mux.take(index, command, now_ns if received_ns is None else received_ns)
        winner = mux.winner(now_ns)
        if winner is not None and self._is_safe(winner):
            passes = index == winner
        else:
            passes = index == self._chosen and mux.may_drive(index, now_ns)
        self._fresh[index] = not passes
        if passes:
            mux.passed_on(index)
        return passes

    def hear_observation(self, place: int, value: float, received_ns: int) -> None:
        """Takes the value of an observation of the robot."""
        self._values[place] = self._robot.observations[place].clamped(value)
        self._heard_ns[place] = received_ns

    @property
    def is_told(self) -> bool:
        """Whether somebody may still tell what the robot achieves. Where those who did have gone, nothing is learned."""
        return self._has_rewards or not self.is_lost

    def look(self, publishers: int, rewarders: int) -> bool:
        """Takes how many nodes publish outcomes, and how many rewards alone, at this moment.

        When the last one that published outcomes has gone, the episode ends as truncated, and nothing is learned from it, because
        what happened may not have been told. From then on, episodes are cut off after `segment_s`, and nothing is learned from them
        unless there are rewards. When somebody publishes outcomes again, a new episode begins.

        Returns:
            Whether the last one has just gone.
        """
        was_told, was_lost = self.is_told, self.is_lost
        is_gone = not publishers and self._looks >= KNOWN_LOOKS
        self._looks = self._looks + 1 if publishers else 0
        self._has_rewards = rewarders > 0
        self.is_lost = is_gone or (was_lost and not publishers)
        self.has_episodes = not is_gone and (self.has_episodes or publishers > 0)
        if is_gone or (was_told and not self.is_told):
            self._misses = True
        if self.is_lost != was_lost or self.is_told != was_told:
            self._ends_now = True
        return is_gone

    def hear_outcome(self, outcome: RobotOutcome) -> None:
        """Takes an outcome; it counts for the time before the next tick. One received between the end of an episode and the first tick
        of the next episode counts for neither."""
        self.has_episodes = not self.is_lost
        self._outcomes.append(outcome)

    def hear_reward(self, reward: float) -> None:
        """Takes a reward of the time before the next tick."""
        self._outcomes.append(RobotOutcome(0, reward))

    def tick(self, clock: Clock) -> list[Ticked]:
        """Decides who drives from now on.

        A tick at which an episode is cut off has two decisions: the one that ends it, after which nobody drives, and the first of the
        next episode.

        Args:
            clock: read when what is learned between two episodes has been learned.

        Raises:
            BadInput: the policy does not belong to these sources.
        """
        begins = self._episode < 0
        if begins:
            begun = None if self.is_done else self._session.next_episode()
            if begun is None:
                self.is_done, self._chosen = True, None
                return []
            self._episode, self._step = begun[0], -1
            self._ends_now, self._misses = False, not self.is_told
        now_ns, stamp_ns = clock()
        if begins:
            self._begun_ns = now_ns
        is_cut = self._ends_now or (not self.has_episodes and not 0 <= now_ns - self._begun_ns < self._segment_ns)
        ticked = self._decide(self._snapshot(now_ns, stamp_ns, is_cut))
        following = self.tick(clock) if is_cut and self._episode < 0 else []
        return [Ticked(ticked.decision), *following] if following else [ticked]

    def _snapshot(self, now_ns: int, stamp_ns: int, is_cut: bool) -> Snapshot:
        mux = self._mux
        winner = mux.winner(now_ns)
        overruled_by = mux.config.sources[winner].name if winner is not None and self._is_safe(winner) else ""
        active: list[bool] = []
        commands: list[float] = []
        ages_s: list[float] = []
        for index in self._sources:
            twist, age_ns = mux.last(index, now_ns)
            is_silent = twist is None or (self._never_expires[index] and not 0 <= age_ns <= SILENT_NS)
            active.append(not is_silent and not overruled_by and mux.may_drive(index, now_ns))
            commands += self._robot.on_axes(twist or Twist())
            ages_s.append(-1.0 if twist is None else age_ns / _NS)
        reward, terminated, truncated, outcome = self._take_outcomes()
        self._step += 1
        if self._misses and self._step > 0 and not (self._ends_now and (terminated or truncated)):
            self._step += 1  # a step of which nothing was told: the session learns nothing more in this episode
            self._misses = False
        return Snapshot(
            stamp_ns,
            self._episode,
            self._step,
            reward,
            terminated,
            truncated or (is_cut and not terminated),
            outcome,
            self._observed(now_ns),
            tuple(active),
            tuple(commands),
            tuple(ages_s),
            overruled_by,
        )

    def _observed(self, now_ns: int) -> tuple[float, ...]:
        return tuple(
            [
                value if not each.max_age_ns or 0 <= now_ns - heard_ns <= each.max_age_ns else nan
                for value, heard_ns, each in zip(self._values, self._heard_ns, self._robot.observations, strict=True)
            ]
        )

    def _take_outcomes(self) -> tuple[float, bool, bool, str]:
        """Reward, terminated, truncated and outcome since the last tick, up to the first end of an episode. At the first tick of an
        episode nothing has been achieved yet: what came before belongs to no decision."""
        reward, terminated, truncated, outcome = 0.0, False, False, ""
        if self._step < 0:
            self._outcomes.clear()
        while self._outcomes and not (terminated or truncated):
            _, more, terminated, truncated, outcome = self._outcomes.pop(0)
            reward += more
        return reward, terminated, truncated and not terminated, outcome

    def _decide(self, snapshot: Snapshot) -> Ticked:
        answers = snapshot.answers(self._leaves)
        command, decision = self._session.decide(snapshot.moment(self._robot.lengths), answers)
        made = snapshot.decided(decision, command)
        drove = self._chosen is not None or self._blends
        self._chosen, self._blends = None, False
        if snapshot.terminated or snapshot.truncated:
            self._episode = -1
            return Ticked(made, send=Twist() if drove and not snapshot.overruled_by else None)
        if decision.driver >= 0:
            self._chosen = index = self._sources[decision.driver]
            if self._fresh[index]:
                self._fresh[index] = False
                self._mux.passed_on(index)
                return Ticked(made, pass_on=index)
        elif any(snapshot.active):
            blended = [index for index, is_active in zip(self._sources, snapshot.active, strict=True) if is_active]
            self._blends = True
            self._mux.passed_on(max(blended, key=lambda index: rank(self._mux.config.sources[index])))
            return Ticked(made, send=self._robot.twist(command))
        return Ticked(made)

    def _is_safe(self, index: int) -> bool:
        return rank(self._mux.config.sources[index]) >= self._safety
