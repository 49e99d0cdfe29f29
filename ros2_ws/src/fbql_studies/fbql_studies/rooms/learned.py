"""Episodes in rooms, in-process, driven by a mux that learns or plays what it has learned."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

from fbql_fusion.core.mux_session import MuxSession
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.tasks.twist.answers import SourceLeaves
from fbql_fusion.core.tasks.twist.moment import MuxMoment
from fbql_fusion.core.tasks.twist.parameters import MuxLearningParameters
from fbql_fusion.core.tasks.twist.task import MuxTask

from fbql_studies.rooms.maps import Room
from fbql_studies.rooms.play import End, end_of, outcome_of
from fbql_studies.rooms.priorities import GatedPriorities, Gates, Setting
from fbql_studies.rooms.robot import PERIOD_S, SPACE, Reading
from fbql_studies.rooms.sources import SOURCES, Source, observe
from fbql_studies.rooms.worlds import World

REWARD, PENALTY = 10.0, -10.0
OBSERVED_LENGTHS = (2, 1, 1, 1, 1, 1)


class Mux:
    """A mux in rooms: a session, its sources, and the priorities that guide it.

    Args:
        setting: of the guide, which is also the prior if `parameters.fbql_prior` is above 0.
        gated: whether a source is masked while its gate is closed.
    """

    def __init__(
        self,
        parameters: MuxLearningParameters,
        setting: Setting,
        policy: Policy | None = None,
        sources: Mapping[str, Source] = SOURCES,
        gated: bool = False,
    ) -> None:
        self._gates = Gates(setting)
        self._guide = GatedPriorities(self._gates.order)
        task = MuxTask(SPACE, PERIOD_S, OBSERVED_LENGTHS)
        self.session = MuxSession(parameters, task, self._guide, policy)
        self._sources = list(sources.values())
        self._leaves = SourceLeaves(SPACE)
        self._gated = gated

    def play(
        self, world: World, rooms: Iterable[Room], see: Callable[[Reading, int], None] = lambda *_: None
    ) -> Iterator[End]:
        """Plays one episode in each room, and learns if the session does. `see` gets each reading and who drives on from it."""
        for room in rooms:
            begun = self.session.next_episode()
            if begun is None:
                return
            yield self._episode(begun[0], world, room, see)

    def _episode(self, episode: int, world: World, room: Room, see: Callable[[Reading, int], None]) -> End:
        self._gates.reset()
        reading = world.reset(room)
        answer = self._leaves.answer
        period_ns = round(PERIOD_S * 1e9)
        while True:
            self._guide.gates = gates = self._gates.open(reading)
            ranges, distance, bearing = reading.ranges, reading.goal_distance_m, reading.goal_bearing_rad
            heard = [
                answer(source(ranges, distance, bearing), True if not self._gated or i >= len(gates) else gates[i])
                for i, source in enumerate(self._sources)
            ]
            terminated, truncated = reading.terminated, reading.truncated
            reward = (PENALTY if reading.collided else REWARD) if terminated else 0.0
            outcome = outcome_of(reading) if terminated else ""
            step = reading.step
            moment = MuxMoment(
                step * period_ns, episode, step, observe(reading), reward, terminated, truncated, outcome
            )
            command, decision = self.session.decide(moment, heard)
            see(reading, decision.driver)
            if terminated or truncated:
                return end_of(room, reading)
            reading = world.step(*command)
