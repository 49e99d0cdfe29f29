"""Writes the tables and figures of docs/fusion.md from docs/data. Run it in the project's environment:

source scripts/env.sh
python docs/make_fusion.py [STUDY_DIRECTORY ...]

Directories of studies (runs/study-paper, runs/study-ladder, ...) are taken into docs/data first: the table and its options as
STUDY.json, what the figures are drawn from as STUDY_curves.json. Between the comments `<!-- table: STUDY: TITLE -->` or
`<!-- figure: STUDY: NAME: CAPTION -->` and `<!-- end -->` stands what this writes; tests/project/test_docs_fusion.py fails
while it does not.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

from fbql.statistics.tables import as_markdown
from fbql_studies.runner.study import study_of

HERE = Path(__file__).resolve().parent
PAGE = HERE / "fusion.md"
DATA = HERE / "data"
IMAGES = HERE / "images"
PLACE = re.compile(r"(<!-- (table|figure): (\w+): ([^:>]*?)(?:: ([^>]*?))? -->\n).*?(<!-- end -->)", re.DOTALL)
STUDIES = ("paper", "ladder", "ablation", "sensitivity", "peers", "scaling")
KEPT = ("table", "columns", "options", "git_revision", "tasks", "done", "failed")


def take(directory: Path) -> None:
    """Takes a study's results into docs/data."""
    study = json.loads((directory / "config.json").read_text())["study"]
    found = json.loads((directory / "table.json").read_text())
    kept = {name: found[name] for name in KEPT}
    (DATA / f"{study}.json").write_text(f"{json.dumps(kept, indent=1)}\n")
    (DATA / f"{study}_curves.json").write_text((directory / "curves.json").read_text())


def page(text: str) -> str:
    """The page with its tables and figures made anew."""
    return PLACE.sub(lambda place: f"{place[1]}{_made(*place.group(2, 3, 4, 5))}\n{place[6]}", text)


def _made(kind: str, study: str, title: str, caption: str | None) -> str:
    path = DATA / (f"{study}.json" if kind == "table" else f"{study}_curves.json")
    if not path.exists():
        return f"*Not measured yet: `python3 scripts/experiment.py {study}`.*"
    data = json.loads(path.read_text())
    if kind == "figure":
        return f"![{caption}](images/fusion_{title}.svg)\n\n*{caption}.*"
    options = " ".join(f"--{name.replace('_', '-')} {value}" for name, value in data["options"].items())
    command = f"*`python3 scripts/experiment.py {study} {options}`, [data](data/{study}.json):*"
    return f"{command}\n\n{as_markdown(study_of(study).words(data['table'])[title])}"


def draw() -> list[Path]:
    """Draws the figures of every study that has data."""
    from fbql_studies.fusion_figures import draw

    found = [DATA / f"{study}_curves.json" for study in STUDIES]
    return [file for path in found if path.exists() for file in draw(json.loads(path.read_text()), IMAGES)]


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        take(Path(argument))
    PAGE.write_text(page(PAGE.read_text()))
    print("\n".join(f"wrote {file}" for file in (PAGE, *draw())))
