"""The colours of the report's page: readable in both schemes, and told apart by colour-blind readers."""

from __future__ import annotations

import re
from itertools import combinations

import numpy as np
import pytest
from places import ROOT

STYLE = ROOT / "ros2_ws/src/fbql/fbql/report/assets/page.css"
LIGHT, DARK = (
    dict(re.findall(r"--([\w-]+): (#[0-9a-f]{3,6});", block))
    for block in re.findall(r":root \{(.*?)\}", STYLE.read_text(), re.DOTALL)
)
SCHEMES = {"light": LIGHT, "dark": DARK}
BEHAVIORS = tuple(f"b{index}" for index in range(6))
SHIPPED = BEHAVIORS[:3]
DEFICIENCIES = {
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
"""Linear RGB as somebody sees it who lacks a kind of cones. Source: Machado, Oliveira and Fernandes, IEEE TVCG 15 (2009)."""


def linear(colour: str) -> np.ndarray:
    """Linear RGB of a colour in hexadecimal sRGB."""
    digits = colour[1:] if len(colour) == 7 else "".join(2 * digit for digit in colour[1:])
    values = np.array([int(digits[at : at + 2], 16) for at in (0, 2, 4)]) / 255
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def contrast(one: str, other: str) -> float:
    """Source: WCAG 2.1, contrast ratio."""
    bright, dark = sorted((float(linear(each) @ [0.2126, 0.7152, 0.0722]) for each in (one, other)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


def lab(rgb: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of linear RGB, D65."""
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    x, y, z = np.cbrt(to_xyz @ np.clip(rgb, 1e-6, 1) / [0.9505, 1.0, 1.089])
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def test_both_schemes_have_the_same_colours():
    assert LIGHT.keys() == DARK.keys() and len(LIGHT) > 15


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("ground", ["paper", "raised", "warn"])
@pytest.mark.parametrize("text", ["ink", "quiet", "accent"])
def test_texts_can_be_read(scheme, ground, text):
    if (ground, text) == ("warn", "accent"):
        pytest.skip("no link stands in a warning")
    assert contrast(SCHEMES[scheme][text], SCHEMES[scheme][ground]) >= 4.5


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("ground", ["paper", "grass"])
@pytest.mark.parametrize("shape", [*BEHAVIORS, "ball", "robot", "good", "bad"])
def test_shapes_stand_out(scheme, ground, shape):
    assert contrast(SCHEMES[scheme][shape], SCHEMES[scheme][ground]) >= 3.0


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("deficiency", DEFICIENCIES)
def test_the_behaviors_colours_differ_for_colour_blind_readers(scheme, deficiency):
    seen = {name: lab(np.array(DEFICIENCIES[deficiency]) @ linear(SCHEMES[scheme][name])) for name in SHIPPED}
    for one, other in combinations(SHIPPED, 2):
        assert np.linalg.norm(seen[one] - seen[other]) > 15, (one, other)
