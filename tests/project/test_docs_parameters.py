"""docs/parameters.md says what the code declares. Here, and not in tests/core, because the node modules need ROS."""

from __future__ import annotations

import runpy

from places import ROOT

DOCS = ROOT / "docs"
GENERATOR = runpy.run_path(str(DOCS / "make_parameters.py"))
"""Run when this module is imported, so that benchmarks/mutants.py attributes the declarations' lines to its test."""


def test_the_parameters_page_is_what_its_generator_writes() -> None:
    page = GENERATOR["page"]()
    assert (DOCS / "parameters.md").read_text() == page, (
        "a declaration changed: in the environment (source scripts/env.sh) run `python docs/make_parameters.py`"
    )
