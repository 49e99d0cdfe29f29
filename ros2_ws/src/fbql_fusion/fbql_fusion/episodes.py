"""The episodes of a run, requested one after another from the simulator's service."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

from fbql_common.core.text import one_line
from fbql_common.core.topic_names import RESET_EPISODE
from fbql_common.core.types import World
from fbql_common.spin import FAILED, GraphNode
from fbql_msgs.srv import ResetEpisode
from rclpy.task import Future

from fbql_fusion.core.assembly import StepAssembly
from fbql_fusion.core.soccer_session import SoccerSession

_ASK_AGAIN_S = 2.0


class Episodes:
    """Requests each episode from the simulator, and again when the answer or the whole episode was lost.

    Owns: what was requested and when. Does not own: the schedule (the session's), the steps of an episode.

    Args:
        lost_after_s: when only world states of other episodes arrive for this long, the episode is lost [s].
        restarted: called when the current episode restarts.
    """

    def __init__(
        self,
        node: GraphNode,
        session: SoccerSession,
        assembly: StepAssembly,
        lost_after_s: float,
        restarted: Callable[[], None],
    ) -> None:
        self._node = node
        self._session = session
        self._assembly = assembly
        self._lost_after_s = lost_after_s
        self._restarted = restarted
        self._client = node.create_client(ResetEpisode, RESET_EPISODE)
        self.service = node.resolve_service_name(RESET_EPISODE)
        self._asked: tuple[int, int] | None = None
        """The episode and seed that were requested and not granted yet."""
        self._asked_s = float("-inf")
        self.heard_s = float("-inf")
        """When the episode's last world state arrived or, before the first, when the episode was requested or
        granted."""
        self.under_way = False
        """Whether an episode was granted and has not ended."""

    def can_ask(self) -> bool:
        """Whether the simulator's service is there."""
        return self._client.service_is_ready()

    def begin(self, episode: int, seed: int) -> None:
        """Requests an episode, the one that the session began."""
        self._begin((episode, seed), anywhere=False)

    def heard_foreign(self, world: World) -> None:
        """Call this for a world state of another episode. If no others arrive, the simulator has lost the episode: it
        was restarted, or somebody else requested another one."""
        if self.under_way and monotonic() - self.heard_s > self._lost_after_s:
            self.under_way = False
            episode, seed = self._session.restart_episode()
            self._restarted()
            self._node.get_logger().error(
                f"the simulator is at episode {world.episode}, step {world.step}: episode {episode} is lost and begins "
                "again; nothing more is learned in it"
            )
            self._begin((episode, seed), anywhere=True)

    def check(self, now_s: float) -> None:
        """Repeats a request that was not answered; repeating it is idempotent (ResetEpisode.srv)."""
        if self._asked is not None and now_s - self._asked_s > _ASK_AGAIN_S and self.can_ask():
            self._ask(self._asked)

    def _begin(self, asked: tuple[int, int], anywhere: bool) -> None:
        self._asked, self._asked_s = asked, float("-inf")
        self.heard_s = monotonic()
        self._assembly.begin(asked[0], anywhere)
        self._ask(asked)

    def _ask(self, asked: tuple[int, int]) -> None:
        if not self.can_ask():
            return  # check() asks as soon as it can
        self._asked_s = monotonic()
        episode, seed = asked
        call = self._client.call_async(ResetEpisode.Request(episode=int(episode), seed=int(seed)))
        call.add_done_callback(self._on_answer)

    def _on_answer(self, call: Future) -> None:
        answer = call.result()
        if not answer.success:
            self._node.get_logger().error(one_line(f"the simulator refused an episode: {answer.message}"))
            self._node.finish(FAILED)
        elif self._asked is not None:
            self._asked = None
            self.under_way = True
            self.heard_s = monotonic()
