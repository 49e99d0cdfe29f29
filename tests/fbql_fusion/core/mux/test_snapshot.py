"""The snapshot of a decision goes into its message and comes out again."""

from __future__ import annotations

from fbql_common.core.types import Decision, Phase
from fbql_fusion.core.mux.learning import NODE
from fbql_fusion.core.mux.snapshot import Snapshot, snapshot_of

NAMES = ("goal", "gap")
SNAPSHOT = Snapshot(
    7, 2, 5, -1.0, False, True, "stuck", (0.5, 1.5), (True, False), (0.2, 0.0, 0.1, 0.3), (0.1, -1.0), "joy"
)


def test_a_snapshot_comes_back_from_the_decision_that_was_based_on_it() -> None:
    decision = Decision(7, 2, 5, "fbql", int(Phase.LEARNING), NAMES, (0, 1), (), (1.0, 0.0), 0, -1.0, False, (0.6, 0.4))
    told = SNAPSHOT.decided(decision, (0.2, 0.0))
    assert snapshot_of(told) == SNAPSHOT
    assert (told.behaviors, told.driver, told.command) == (NAMES, 0, (0.2, 0.0))


def test_a_recording_names_the_node_by_the_name_of_its_executable() -> None:
    assert NODE == "twist_mux"
