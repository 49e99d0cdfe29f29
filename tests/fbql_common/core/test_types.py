"""What the numbers in messages and recordings stand for."""

from __future__ import annotations

from fbql_common.core.types import DRIVER_BLEND, NO_LEAF, Phase


def test_the_numbers_in_messages_and_recordings_stay() -> None:
    assert [int(phase) for phase in Phase] == [0, 1, 2]
    assert [phase.name for phase in Phase] == ["GUIDED", "LEARNING", "EVALUATION"]
    assert (DRIVER_BLEND, NO_LEAF) == (-1, -1)
