"""The look of our matplotlib figures, and how they are written: the same figure, the same bytes."""

from __future__ import annotations

from io import BytesIO

from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

STYLE = {
    "font.size": 9,
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial"],
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "report",
    "pdf.fonttype": 42,
}
"""For `matplotlib.rc_context`."""
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#555555"
"""Distinguishable for colour-blind readers (Okabe and Ito)."""


def svg_bytes(figure: Figure) -> bytes:
    """A figure as SVG, without a date."""
    data = BytesIO()
    FigureCanvasSVG(figure).print_svg(data, metadata={"Date": None, "Creator": None})
    return data.getvalue()


def pdf_bytes(figure: Figure) -> bytes:
    """A figure as PDF, without a date."""
    data = BytesIO()
    FigureCanvasPdf(figure).print_pdf(data, metadata={"CreationDate": None, "Creator": None, "Producer": None})
    return data.getvalue()


def text(words: str) -> str:
    """A text as matplotlib can show it: a dollar sign would begin a formula, a control character make the SVG invalid."""
    shown = "".join(each if each.isprintable() or each == "\n" else " " for each in words)
    return shown.replace("$", r"\$")
