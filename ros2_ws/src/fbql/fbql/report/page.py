"""The report of a run: one HTML page that stands alone and asks no network for anything.

Its security policy says so to the browser too: no request is allowed, and no program but the page's own runs.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable
from pathlib import Path
from string import Template
from tempfile import TemporaryFile
from typing import TextIO

from fbql_recording import Run

from fbql.report import sections
from fbql.report.contents import Contents, page_data, read_contents
from fbql.report.texts import html, json_for_html

ASSETS = Path(__file__).parent / "assets"
PROGRAM = ("data.js", "surface.js", "field.js", "moment.js", "timelines.js", "player.js", "main.js")
"""In the order in which they need each other."""


def write_page(run: Run, out: TextIO, progress: Callable[[int], None]) -> Contents:
    """Writes the report of a run. The steps are read once, and go by way of a temporary file.

    Args:
        out: where to.
        progress: told how many steps are read, now and then; what it raises ends the writing.

    Raises:
        BadInput: there is no step in it; `Corrupt`.
    """
    with TemporaryFile("w+", encoding="ascii") as blocks:
        contents = read_contents(run, blocks, progress)
        style = (ASSETS / "page.css").read_text(encoding="utf-8")
        program = "\n".join((ASSETS / name).read_text(encoding="utf-8") for name in PROGRAM)
        program = f'(() => {{\n"use strict";\n{program}\n}})();'
        page = Template((ASSETS / "page.html").read_text(encoding="utf-8"))
        before, after = page.substitute(
            policy=f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; script-src '{_hash(program)}'",
            style=style,
            title=html(run.path.name),
            headline=_headline(contents),
            tiles=sections.tiles(contents),
            warnings=sections.warnings(contents),
            senses=sections.senses(contents),
            controllers=sections.controllers(contents),
            episodes=sections.episodes(contents),
            about=sections.about(contents, sections.file_digests(run)),
            precision=sections.precision(),
            data=json_for_html(page_data(contents)),
            program=program,
            blocks="\0",
        ).split("\0")
        out.write(before)
        blocks.seek(0)
        for line in blocks:
            out.write(f'<script type="text/plain" class="block">{line.rstrip()}</script>\n')
        out.write(after)
    return contents


def _hash(text: str) -> str:
    """A script or style as a security policy names it."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def _headline(contents: Contents) -> str:
    parameters = contents.run.parameters.get("fusion", {})
    parts = [", ".join(contents.controllers) or "controller n/a"]
    seed = parameters.get("seed") if isinstance(parameters, dict) else None
    parts.append(f"seed {seed if isinstance(seed, int) else 'n/a'}")
    parts.append(f"{contents.steps} steps in {len(contents.episodes)} episodes")
    return html(" · ".join(parts))
