"""Learning between two episodes, in a separate thread, so that the node stays responsive."""

from __future__ import annotations

from threading import Thread
from time import monotonic

from fbql_fusion.core.soccer_session import SoccerSession


class Reflection:
    """Takes a session to its next episode. Until that is done, nobody else may call the session, except for its policy.

    The thread ends with the process: an interrupted run keeps the policy from before.
    """

    def __init__(self, session: SoccerSession) -> None:
        self._session = session
        self._begun_s = monotonic()
        self._asked: tuple[int, int] | None = None
        self._error: BaseException | None = None
        self._thread = Thread(target=self._run, name="reflection", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._asked = self._session.next_episode()
        except BaseException as error:  # raised again where somebody waits for it
            self._error = error

    @property
    def is_under_way(self) -> bool:
        """Whether the session is still busy."""
        return self._thread.is_alive()

    @property
    def lasts_s(self) -> float:
        """For how long it has been [s]."""
        return monotonic() - self._begun_s

    def next_episode(self) -> tuple[int, int] | None:
        """What `Session.next_episode` returned, once it has; raises what it raised."""
        self._thread.join()
        if self._error is not None:
            raise self._error
        return self._asked
