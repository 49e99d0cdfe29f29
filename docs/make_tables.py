"""Writes the tables of the studies into docs/trees.md, from docs/data. Run it in the project's environment:

source scripts/env.sh
python docs/make_tables.py

A table stands between two comments, `<!-- table: STUDY: TITLE -->` and `<!-- end -->`. tests/core/test_docs_trees.py fails
while the page is not what this would write.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "scripts"))

from studies import leaf_tuning_words, objectives_words, tree_words  # noqa: E402

PAGE = HERE / "trees.md"
TABLES = {
    "trees": tree_words.tables,
    "objectives": objectives_words.tables,
    "leaf_tuning": leaf_tuning_words.tables,
}
PLACE = re.compile(r"(<!-- table: (\w+): (.*?) -->\n).*?(<!-- end -->)", re.DOTALL)


def page(text: str) -> str:
    """The page with its tables made anew."""
    made = {
        (study, title): table
        for study, tables in TABLES.items()
        for title, table in tables(json.loads((HERE / "data" / f"{study}.json").read_text())["table"]).items()
    }
    return PLACE.sub(lambda place: f"{place[1]}{made[place[2], place[3]]}\n{place[4]}", text)


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text()))
    print(f"wrote {PAGE}")
