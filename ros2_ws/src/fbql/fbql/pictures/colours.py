"""The colors of the report's page, for pictures outside it, read from the same file."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

SIGNS = "●■▲◆★✚"
"""The sign beside each behavior's color, as in the report: never a color alone."""
_STYLE = Path(__file__).parents[1] / "report" / "assets" / "page.css"


@cache
def report_colours() -> dict[str, str]:
    """Name -> colour, such as grass, ball or b0 (of the first behavior), of the light scheme."""
    scheme = _STYLE.read_text(encoding="utf-8").partition("}")[0]
    return dict(re.findall(r"--([\w-]+): (#[0-9a-f]{3,6});", scheme))


def behavior_colour(index: int) -> str:
    """The colour of a behavior by its place; of none, where they drive together."""
    return report_colours()["ink" if index < 0 else f"b{index % len(SIGNS)}"]
