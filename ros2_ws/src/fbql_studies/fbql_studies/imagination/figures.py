"""The figure of the study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from fbql_studies.common.drawing import intervals_figure


def imagination_figure(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """The cost of every training relative to the Subsumption that is re-tuned in the same world."""
    return intervals_figure(
        rows, name="ratio_retuned", label="cost/goal to the re-tuned Subsumption's in the same world"
    )


FIGURES = {"imagination": imagination_figure}
