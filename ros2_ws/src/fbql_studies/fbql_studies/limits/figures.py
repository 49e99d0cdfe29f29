"""The figure of the study."""

from __future__ import annotations

from functools import partial

from fbql_studies.common.drawing import intervals_figure

FIGURES = {"limits": partial(intervals_figure, name="ratio_tuned_law", label="cost/goal to the tuned law's")}
