"""Writes the tables of the studies into docs/trees.md, from docs/data. Run it in the project's environment:

source scripts/env.sh
python docs/make_tables.py

A table stands between two comments, `<!-- table: STUDY: TITLE -->` and `<!-- end -->`. tests/project/test_docs_trees.py fails
while the page is not what this would write.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from fbql.statistics.tables import as_markdown
from fbql_studies.runner.study import study_of

HERE = Path(__file__).resolve().parent
PAGE = HERE / "trees.md"
STUDIES = ("trees", "objectives", "leaf_tuning")
PLACE = re.compile(r"(<!-- table: (\w+): (.*?) -->\n).*?(<!-- end -->)", re.DOTALL)


def page(text: str) -> str:
    """The page with its tables made anew."""
    made = {
        (study, title): as_markdown(table)
        for study in STUDIES
        for title, table in study_of(study).words(_rows(study)).items()
    }
    return PLACE.sub(lambda place: f"{place[1]}{made[place[2], place[3]]}\n{place[4]}", text)


def _rows(study: str) -> list[Any]:
    return json.loads((HERE / "data" / f"{study}.json").read_text())["table"]


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text()))
    print(f"wrote {PAGE}")
