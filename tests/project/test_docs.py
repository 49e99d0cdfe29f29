"""What the documents name exists: links, files, commands and their options, code, tests, messages, values."""

from __future__ import annotations

import ast
import importlib
import json
import re
import shlex
from fractions import Fraction
from functools import cache
from pathlib import Path

import pytest
import yaml
from fbql.cli.app import COMMANDS
from fbql_behaviors.core.induction import InductionParameters
from fbql_behaviors.core.instructors import Habits
from fbql_behaviors.core.leaf_tuning import TuningParameters
from fbql_behaviors.core.recipes import Recipe
from fbql_fusion.core.controllers.parameters import SessionParameters
from fbql_fusion.core.learners.dyna.parameters import FbqlModelParameters
from fbql_fusion.core.learners.literal.parameters import LiteralParameters
from fbql_fusion.core.learners.parameters import FeatureParameters
from fbql_fusion.core.learners.ppo.parameters import FbqlParameters, PpoParameters, PpoUpdateParameters
from fbql_fusion.core.learners.value.parameters import FbqlValueParameters, ValueParameters
from fbql_fusion.core.tasks.soccer.parameters import SoccerParameters
from fbql_fusion.core.tasks.soccer.subsumption import PRESETS, SubsumptionParameters
from fbql_fusion.core.tasks.soccer.world_model.parameters import WorldModelParameters
from fbql_fusion.node_parameters import FusionNodeParameters
from fbql_sim.core.parameters import SimulationParameters
from places import ROOT

SOURCE = ROOT / "ros2_ws" / "src"
DOCUMENTS = {
    str(path.relative_to(ROOT)): path
    for pattern in (
        "*.md",
        "docs/*.md",
        "docs/course/*.md",
        "docs/results/*.md",
        "examples/*/README.md",
        "ros2_ws/src/*/README.md",
    )
    for path in sorted(ROOT.glob(pattern))
}
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"`([^`\n]+)`")
OF_STUDIES = {"experiment": "fbql_studies.experiment", "sweep": "fbql_studies.sweep.command"}
"""Commands of another package than fbql -> their modules."""
COMMAND = re.compile(r"(?:python3 scripts/(?=\w+\.py)|(?:ros2 run )?fbql )(\w+)(?:\.py)?\b(.*)")
EXECUTABLE = re.compile(r"ros2 run (fbql_\w+) (\w+)")
PLACE = re.compile(r"(?<![\w/.])((?:scripts(?!/[A-Z]+\.)|docs|tests|benchmarks|cmake|ros2_ws)/[\w./*-]*\w|\.ci/run)")
CELL_PLACE = re.compile(r"(?:`|\s)([\w.]+(?:/[\w.]+)*(?:/|\.py|\.msg))(?=`|\s)")
"""A file or folder that is named in a cell."""
NAME_IN_FILE = re.compile(r"`(\w+)` (?:in|of) `([\w./]+\.py)`")
SOURCES = ("benchmarks", "docs", "examples", "ros2_ws/src", "requirements", "scripts", "tests")
MADE = ("ros2_ws/build", "ros2_ws/install", "ros2_ws/log")
"""Places that only the set-up makes."""
DOTTED = re.compile(r"fbql_\w+(?:\.\w+)+")
MEMBER = re.compile(r"([A-Z]\w*[a-z]\w*)\.(?!md\b|msg\b|rst\b|srv\b|txt\b)([a-z_]\w*)")
TEST = re.compile(r"(tests/[\w/]+\.py)::(\w+)")


DECLARATIONS = {
    declaration.__name__: declaration
    for declaration in (
        FbqlModelParameters,
        FbqlParameters,
        FbqlValueParameters,
        FeatureParameters,
        FusionNodeParameters,
        Habits,
        InductionParameters,
        LiteralParameters,
        PpoParameters,
        PpoUpdateParameters,
        Recipe,
        SessionParameters,
        SoccerParameters,
        SimulationParameters,
        SubsumptionParameters,
        ValueParameters,
        TuningParameters,
        WorldModelParameters,
    )
}


def every_document() -> pytest.MarkDecorator:
    """Once for each document."""
    return pytest.mark.parametrize("path", DOCUMENTS.values(), ids=DOCUMENTS)


def slug(heading: str) -> str:
    """The anchor that GitHub gives a heading."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower().replace("`", "")).replace(" ", "-")


def anchors(path: Path) -> set[str]:
    """All anchors of a document."""
    text = FENCE.sub("", path.read_text())
    return {slug(heading) for heading in re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)}


@cache
def names(path: Path) -> dict[str, set[str]]:
    """The names that a module defines at its top, with the names of each class's members."""
    found: dict[str, set[str]] = {}
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ClassDef):
            found[node.name] = {name for statement in node.body for name in defined(statement)} | {
                target.attr
                for inner in ast.walk(node)
                for target in (inner.targets if isinstance(inner, ast.Assign) else [])
                if isinstance(target, ast.Attribute)
            }
        else:
            found.update({name: set[str]() for name in defined(node)})
    return found


def defined(node: ast.stmt) -> list[str]:
    """The names that a statement defines."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return [target.id for target in targets if isinstance(target, ast.Name)]


@cache
def classes() -> dict[str, set[str]]:
    """Every class of the packages and the launchers, with its members; those of one name together."""
    found: dict[str, set[str]] = {}
    for folder in (SOURCE, ROOT / "scripts"):
        for path in folder.rglob("*.py"):
            for name, members in names(path).items():
                if name[0].isupper() and members:
                    found.setdefault(name, set()).update(members)
    return found


def is_code(dotted: str) -> bool:
    """Whether package.module.name.member, or the first parts of that, is there."""
    parts = dotted.split(".")
    place = SOURCE / parts[0]
    for index, part in enumerate(parts):
        place /= part
        if place.with_suffix(".py").is_file():
            name, *member = [*parts[index + 1 :], ""][:2]
            members = names(place.with_suffix(".py")).get(name)
            return not name or (members is not None and (not member or not member[0] or member[0] in members))
        if not place.is_dir():
            return False
    return True


def test_every_package_has_a_readme_and_the_main_one_leads_to_every_document() -> None:
    packages = {path.parent.name for path in SOURCE.glob("*/package.xml")}
    assert {path.parent.name for path in DOCUMENTS.values() if path.parent.parent == SOURCE} == packages
    read = {target.partition("#")[0] for target in LINK.findall((ROOT / "README.md").read_text())}
    assert not {name for name in DOCUMENTS if name.startswith("docs/") and name.count("/") == 1} - read


def test_the_readme_names_every_command_and_shows_few_results() -> None:
    text = (ROOT / "README.md").read_text()
    for name in (*COMMANDS, *OF_STUDIES):
        assert re.search(rf"^\| `{name}\b", text, re.MULTILINE), name
    results = text.partition("## Results")[2].partition("\n## ")[0]
    assert len([line for line in results.splitlines() if line.startswith("|")]) - 2 <= 8


def test_the_page_about_fusion_is_short_enough_to_be_read() -> None:
    assert len((ROOT / "docs" / "fusion.md").read_text().split()) <= 4000


def test_the_citation_is_of_this_version_and_names_the_paper() -> None:
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert cited["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= set(cited)
    assert f'version = "{cited["version"]}"' in (ROOT / "pyproject.toml").read_text()
    assert cited["references"][0]["title"] == "Behavioral-Fusion Control Based on Reinforcement Learning"


@every_document()
def test_no_link_is_dead(path: Path) -> None:
    dead: list[str] = []
    for target in LINK.findall(FENCE.sub("", path.read_text())):
        if re.match(r"[a-z]+:", target):
            continue
        file, _, anchor = target.partition("#")
        goal = (path.parent / file).resolve() if file else path
        if not goal.exists() or (anchor and anchor not in anchors(goal)):
            dead.append(target)
    assert not dead


@pytest.mark.parametrize("path", sorted(SOURCE.glob("*/README.md")), ids=lambda path: path.parent.name)
def test_no_link_of_a_package_leaves_it(path: Path) -> None:
    """A package is published without the repository around it."""
    files = {target.partition("#")[0] for target in LINK.findall(path.read_text()) if not re.match(r"[a-z]+:", target)}
    assert not {file for file in files if not (path.parent / file).resolve().is_relative_to(path.parent)}


@every_document()
def test_every_file_and_command_that_is_told_of_is_there(path: Path) -> None:
    told = {place for place in PLACE.findall(path.read_text()) if not place.startswith(MADE)}
    assert not {place for place in told if not any(ROOT.glob(place))}


def test_everything_that_contributing_says_to_open_is_there() -> None:
    """A place may be the end of a path, as where a row has named the folder before."""
    table = "\n".join(line for line in (ROOT / "CONTRIBUTING.md").read_text().splitlines() if line.startswith("|"))
    files = [
        path.relative_to(ROOT).as_posix() for root in SOURCES for path in (ROOT / root).rglob("*") if path.is_file()
    ]
    for place in CELL_PLACE.findall(table):
        if "NAME" not in place and not place.startswith("runs/"):
            end = place.rstrip("/")
            assert any(f"/{file}".endswith(f"/{end}") or f"/{end}/" in f"/{file}" for file in files), place
    for name, place in NAME_IN_FILE.findall(table):
        texts = [(ROOT / file).read_text() for file in files if f"/{file}".endswith(f"/{place}")]
        assert any(re.search(rf"\b{name}\b", text) for text in texts), (name, place)


@every_document()
def test_every_command_line_is_one_that_its_command_takes(path: Path) -> None:
    for block in FENCE.findall(path.read_text()):
        for line in block.replace("\\\n", " ").splitlines():
            found = COMMAND.match(line)
            if found and found[1] != "test":
                module = OF_STUDIES.get(found[1], f"fbql.commands.{found[1]}")
                try:
                    importlib.import_module(module).parser(found[1]).parse_args(shlex.split(found[2], comments=True))
                except SystemExit:
                    pytest.fail(f"not a command line: {line}")


@every_document()
def test_every_executable_is_one_of_its_package(path: Path) -> None:
    for package, executable in EXECUTABLE.findall(path.read_text()):
        assert re.search(rf'"{executable}\b', (SOURCE / package / "setup.py").read_text()), (package, executable)


@every_document()
def test_every_name_in_the_code_that_is_told_of_is_there(path: Path) -> None:
    wrong: list[str] = []
    for code in CODE.findall(FENCE.sub("", path.read_text())):
        token = code.partition(" = ")[0]
        if DOTTED.fullmatch(token) and not is_code(token):
            wrong.append(token)
        member = MEMBER.fullmatch(token)
        if member and member[2] not in classes().get(member[1], set()):
            wrong.append(token)
    assert not wrong


def test_every_value_that_is_told_is_the_one_in_force() -> None:
    text = FENCE.sub("", (ROOT / "docs" / "deviations.md").read_text())
    told = [code.split(" = ") for code in CODE.findall(" ".join(text.split())) if " = " in code]
    assert len(told) > 40
    wrong = {name: value for name, value in told if not is_value(in_force(name), value)}
    assert not wrong


def in_force(name: str) -> object:
    """The value of a declaration's default, or of a module's constant."""
    place, _, member = name.rpartition(".")
    if place in DECLARATIONS:
        return getattr(DECLARATIONS[place](), member)
    return getattr(importlib.import_module(place), member)


def is_value(value: object, text: str) -> bool:
    """Whether a text tells a value: a number or a fraction, or the words themselves."""
    if isinstance(value, list):
        return ", ".join(value) == text  # pyright: ignore[reportUnknownArgumentType, reportUnknownVariableType]
    return str(value) == text if isinstance(value, str) else float(Fraction(text)) == value


@every_document()
def test_every_test_that_is_told_of_is_there(path: Path) -> None:
    told = TEST.findall(path.read_text())
    assert not [
        f"{file}::{test}" for file, test in told if not (ROOT / file).is_file() or test not in names(ROOT / file)
    ]


def test_the_map_from_the_paper_to_the_code_tells_of_every_equation_and_figure() -> None:
    text = (ROOT / "docs" / "paper_to_code.md").read_text()
    for number in range(1, 21):
        assert f"| eq. {number} |" in text
    for number in range(1, 15):
        assert re.search(rf"^\|.*Fig\. {number}\b", text, flags=re.MULTILINE), number


def test_deviations_are_numbered_from_one_without_a_gap() -> None:
    text = (ROOT / "docs" / "deviations.md").read_text()
    numbers = [int(number) for number in re.findall(r"^#### (\d+)\.", text, flags=re.MULTILINE)]
    assert numbers == list(range(1, len(numbers) + 1))
    assert len(numbers) > 20


def test_the_presets_are_as_told() -> None:
    text = " ".join((ROOT / "docs" / "deviations.md").read_text().split())
    for name, thresholds in PRESETS.items():
        assert f"`{name}` ({thresholds.wall_m:g} m, {thresholds.approach_rad:g} rad)" in text


def test_the_shipped_trees_are_as_told() -> None:
    text = " ".join((ROOT / "docs" / "deviations.md").read_text().split())
    trees = [
        json.loads((SOURCE / "fbql_behaviors" / "fbql_behaviors" / "trees" / f"{name}.json").read_text())
        for name in ("ball_seeking", "wall_avoiding", "approaching")
    ]
    leaves = [str(len(tree["leaves"])) for tree in trees]
    costs = [str(tree["origin"]["split_cost"]) for tree in trees]
    assert "have {}, {} and {} leaves.".format(*leaves) in text
    assert "*Here:* {}, {} and {} nat for".format(*costs) in text


@pytest.mark.parametrize("path", sorted(SOURCE.glob("fbql_msgs/*/*.*")), ids=lambda path: path.name)
def test_every_field_of_a_message_is_in_the_readme_with_its_unit(path: Path) -> None:
    readme = (SOURCE / "fbql_msgs" / "README.md").read_text()
    assert f"### {path.stem}\n" in readme
    section = readme.partition(f"### {path.stem}\n")[2].partition("\n##")[0]
    rows = [row for row in section.splitlines() if row.startswith("| `")]
    expected: list[str] = []
    for line in path.read_text().splitlines():
        field = re.fullmatch(r"(\S+) (\w+)\s+# (.*)", line)
        if field:
            kind, name, text = field.groups()
            unit = re.search(r" \[([^\]]*)\]", text)
            assert unit, f"{name} has no unit"
            meaning = text.replace(unit[0], "", 1).replace("<", "\\<")
            expected.append(f"| `{name}` | {kind} | {unit[1]} | {meaning} |")
    assert expected
    assert rows == expected
