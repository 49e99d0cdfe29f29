"""The colors of every picture. Left is blue, right is orange, forwards is green, backwards is dark."""

from __future__ import annotations

from fbql_behaviors.core.explanation import Motion

COLOURS = {
    Motion.STAND: "#cfcfcf",
    Motion.FORWARDS: "#3aa655",
    Motion.FORWARDS_LEFT: "#56b4e9",
    Motion.SPIN_LEFT: "#1f5fa8",
    Motion.BACKWARDS_LEFT: "#7d5ba6",
    Motion.BACKWARDS: "#6b6b6b",
    Motion.BACKWARDS_RIGHT: "#b0405e",
    Motion.SPIN_RIGHT: "#d9541e",
    Motion.FORWARDS_RIGHT: "#f0b323",
    Motion.SIDEWAYS_LEFT: "#009e73",
    Motion.SIDEWAYS_RIGHT: "#cc79a7",
}
"""The color of a motion."""
OPACITY = {"slow": 0.45, "": 0.7, "fast": 1.0}
"""The strength of the color, by speed."""
INK, FAINT, FRAME = "#222", "#777", "#444"
CURVE, LEVEL = "#1f5fa8", "#d9541e"
"""A curve, and a level to compare it with."""
