"""The figure of the study: the cost of every variant."""

from __future__ import annotations

from functools import partial

from fbql_studies.common.drawing import intervals_figure

FIGURES = {"sensitivity": partial(intervals_figure, name="ratio_default", label="cost/goal to the default's")}
