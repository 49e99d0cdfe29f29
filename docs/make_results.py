"""Writes docs/results and the small tables of docs/fusion.md, trees.md and imagination.md from docs/data. Run it in the project's
environment:

source scripts/env.sh
python docs/make_results.py [STUDY_DIRECTORY ...]

A study directory (runs/study-paper, runs/study-ladder, ...) is first copied into docs/data: its table and options as
STUDY.json, the numbers behind its figures as STUDY_curves.json; figures that need every task's result are copied into
docs/images. Each study then gets its own page, docs/results/STUDY.md, which contains nothing written by hand.
docs/data/measurements.json lists every measurement that was taken so far, so that a page says how often its tree sets and
run seeds were measured on.

In these pages a generated block stands between a comment and `<!-- end -->`:

<!-- table: STUDY: TITLE -->
<!-- table: STUDY: TITLE | rows: FIRST CELL; FIRST CELL | columns: HEAD; HEAD -->
<!-- figure: STUDY: NAME -->

tests/project/test_docs_results.py fails while a page is not what this writes.
"""

from __future__ import annotations

import json
import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from fbql.statistics.tables import Table, as_markdown
from fbql_common.files import write_atomically
from fbql_studies.runner.study import STUDIES, study_of

HERE = Path(__file__).resolve().parent
DATA = HERE / "data"
IMAGES = HERE / "images"
RESULTS = HERE / "results"
PAGES = (HERE / "fusion.md", HERE / "trees.md", HERE / "imagination.md")
PLACE = re.compile(r"(<!-- (table|figure): (\w+): ([^|>]+?)((?: \| \w+: [^|>]+?)*) -->\n).*?(<!-- end -->)", re.DOTALL)
MEASUREMENTS = "measurements.json"
KEPT = ("table", "columns", "options", "git_revision", "tasks", "done", "failed")


def take(directory: Path) -> None:
    """Copies a study's results into docs/data, and its figures into docs/images where they can't be redrawn from there."""
    study = json.loads((directory / "config.json").read_text())["study"]
    found = json.loads((directory / "table.json").read_text())
    kept = {name: found[name] for name in KEPT}
    write_atomically(DATA / f"{study}.json", f"{json.dumps(kept, indent=1)}\n".encode())
    _note_measurement(study, kept)
    if (directory / "curves.json").exists():
        write_atomically(DATA / f"{study}_curves.json", (directory / "curves.json").read_bytes())
    else:
        for figure in directory.glob("*.svg"):
            write_atomically(IMAGES / figure.name, figure.read_bytes())


def _note_measurement(study: str, new: dict[str, Any]) -> None:
    """Adds a measurement to the list, unless it is the one that was taken last."""
    fbql = next((row for row in new["table"] if row.get("method") == "fbql"), {})
    options, own = new["options"], getattr(study_of(study), "SEEDS", (None, None))
    entry = {
        "study": study,
        "first_trees": options.get("first_trees", own[0]),
        "first_seed": options.get("first_seed", own[1]),
        "git_revision": new["git_revision"],
        "fbql_cost_per_goal": fbql.get("cost_per_goal"),
    }
    every = _measurements()
    if [each for each in every if each["study"] == study][-1:] != [entry]:
        write_atomically(DATA / MEASUREMENTS, f"{json.dumps([*every, entry], indent=1)}\n".encode())


def _measurements() -> list[dict[str, Any]]:
    """Every measurement that was taken, in order."""
    path = DATA / MEASUREMENTS
    return json.loads(path.read_text()) if path.exists() else []


def how_often(study: str) -> str:
    """How often a study, and others, were measured on the tree sets and run seeds of its latest measurement; "" if it has
    none."""
    every = _measurements()
    own = [each for each in every if each["study"] == study]
    if not own:
        return ""
    sets = [(each["first_trees"], each["first_seed"]) for each in own]
    on_same = [each for each, its in zip(own, sets, strict=True) if its == sets[-1]]
    if sets[-1] == (None, None):
        again = " on the same seeds" if len(on_same) > 1 else ""
        return f"Measured {_times(len(on_same))}{again}."
    text = (
        f"Measured {_times(len(on_same))} on these tree sets and run seeds (from demonstration seed {sets[-1][0]} and run "
        f"seed {sets[-1][1]} on)"
    )
    costs = [each["fbql_cost_per_goal"] for each in on_same]
    if len(on_same) > 1 and None not in costs:
        text += f", with fbql's cost/goal at {', '.join(f'{cost:.0f}' for cost in costs)}"
    others = [
        each["study"]
        for each in every
        if (each["first_trees"], each["first_seed"]) == sets[-1] and each["study"] != study
    ]
    for other in dict.fromkeys(others):
        text += f"; `{other}` was measured on them {_times(others.count(other))}"
    repeated = len(on_same) + len(others) > 1
    return f"{text}.{' What was changed in between may fit them.' if repeated else ''}"


def _times(count: int) -> str:
    return {1: "once", 2: "twice"}.get(count, f"{count} times")


def results_page(study: str) -> str:
    """The page of a study's results."""
    module, data = study_of(study), _data(study)
    parts = [f"# Results: {study.replace('_', ' ')}", f"{_capitalized(module.DESCRIPTION)}."]
    if data is None:
        return "\n\n".join([*parts, _not_measured(study)]) + "\n"
    parts += [
        f"```\n{_command(study, data)}\n```",
        f"Measured at revision {data['git_revision']}. Written by `docs/make_results.py` from "
        f"[{study}.json](../data/{study}.json), which describes every column.",
        *filter(None, [how_often(study)]),
    ]
    parts += [f"## {_capitalized(title)}\n\n{as_markdown(table)}" for title, table in _tables(study, data).items()]
    if module.CAPTIONS:
        parts.append("## Figures")
    parts += [_figure(file, caption, "../images") for file, caption in module.CAPTIONS.items()]
    return "\n\n".join(parts) + "\n"


def index_page() -> str:
    """The list of all results."""
    rows = [[f"[{name}]({name}.md)", study_of(name).DESCRIPTION] for name in sorted(STUDIES)]
    return (
        "# Results of the studies\n\nOne page per study, written by `docs/make_results.py`. Conclusions: "
        "[fusion.md](../fusion.md), [trees.md](../trees.md); how to run a study: [studies.md](../studies.md).\n\n"
        f"{as_markdown(Table(['study', 'what'], rows))}\n"
    )


def page(text: str) -> str:
    """A page with its generated blocks regenerated."""
    return PLACE.sub(lambda place: f"{place[1]}{_block(*place.group(2, 3, 4, 5))}\n{place[6]}", text)


def _block(kind: str, study: str, title: str, choice: str) -> str:
    data = _data(study)
    if data is None:
        return _not_measured(study)
    if kind == "figure":
        return _figure(title, study_of(study).CAPTIONS[title], "images")
    link = f"*`{_command(study, data)}`, [all results](results/{study}.md#{_anchor(title)})*"
    return f"{as_markdown(_chosen(_tables(study, data)[title], choice))}\n\n{link}"


def _chosen(table: Table, choice: str) -> Table:
    """The rows and columns of a table that a comment names, in its order; all if it names none."""
    wanted = {kind: names.strip().split("; ") for kind, names in re.findall(r"\| (\w+): ([^|]+)", choice)}
    columns = [table.head.index(name) for name in wanted.get("columns", table.head)]
    by_name = {row[0]: row for row in table.body}
    rows = [by_name[name] for name in wanted["rows"]] if "rows" in wanted else table.body
    return Table([table.head[i] for i in columns], [[row[i] for i in columns] for row in rows])


def _figure(file: str, caption: str, images: str) -> str:
    return f"![{caption}]({images}/{file}.svg)\n\n*{caption}.*"


def _tables(study: str, data: dict[str, Any]) -> dict[str, Table]:
    return study_of(study).words(data["table"])


def _data(study: str) -> dict[str, Any] | None:
    """A study's data; None where it has not been measured."""
    path = DATA / f"{study}.json"
    return json.loads(path.read_text()) if path.exists() else None


def _not_measured(study: str) -> str:
    return f"*Not measured yet: `python3 scripts/experiment.py {study}`.*"


def _command(study: str, data: dict[str, Any]) -> str:
    options = " ".join(
        f"--{name.replace('_', '-')} {' '.join(map(str, value)) if isinstance(value, list) else value}"
        for name, value in data["options"].items()
    )
    return f"python3 scripts/experiment.py {study} {options}"


def _capitalized(text: str) -> str:
    return text[:1].upper() + text[1:]


def _anchor(title: str) -> str:
    """The anchor that GitHub gives to a heading."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def draw() -> list[Path]:
    """Redraws the figures of every study whose numbers are in docs/data."""
    from fbql_studies.common.drawing import draw

    files: list[Path] = []
    for study in STUDIES:
        path = DATA / f"{study}_curves.json"
        if path.exists():
            figures = import_module(f"fbql_studies.{study}.figures").FIGURES
            files += draw(figures, json.loads(path.read_text()), IMAGES)
    return files


def pages() -> dict[Path, str]:
    """Every page that this writes -> its text."""
    return {
        RESULTS / "README.md": index_page(),
        **{RESULTS / f"{study}.md": results_page(study) for study in sorted(STUDIES)},
        **{path: page(path.read_text()) for path in PAGES},
    }


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        take(Path(argument))
    RESULTS.mkdir(exist_ok=True)
    for path, text in pages().items():
        write_atomically(path, text.encode())
        print(f"wrote {path}")
    print("\n".join(f"wrote {file}" for file in draw()))
