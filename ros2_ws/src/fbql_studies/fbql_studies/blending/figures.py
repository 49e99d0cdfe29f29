"""The figure of the study."""

from __future__ import annotations

from fbql_studies.common.drawing import costs_figure

FIGURES = {"blending": costs_figure}
