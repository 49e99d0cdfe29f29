"""The report of an induction: one self-contained HTML page, with the input, the course of the induction, and the tree
explained.

The page holds no clock and no path of this machine: the same induction gives the same page, byte for byte.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from math import degrees, isfinite
from typing import Any

import numpy as np
from fbql_behaviors.core.explanation import Rule, rules
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.patterns import Patterns
from fbql_behaviors.core.quantizer import rad_s_of
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.drawing.colours import COLOURS, OPACITY
from fbql_behaviors.drawing.coverage import coverage_svg
from fbql_behaviors.drawing.curve import curve_svg
from fbql_behaviors.drawing.partition import partition_svg
from fbql_behaviors.storage import tree_to_bytes
from fbql_common.core.field import WHEELS

from fbql.cli.words import counted, percent
from fbql.demonstrations.skill import SkillReport

STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 1040px; margin: 0 auto; padding: 24px; }
h1 { font-size: 26px; margin: 0; } h2 { font-size: 19px; margin: 36px 0 8px; }
p { max-width: 75ch; } .quiet { color: #666; } code { font: 13px ui-monospace, monospace; overflow-wrap: anywhere; }
pre { font: 12px ui-monospace, monospace; white-space: pre-wrap; overflow-wrap: anywhere; } summary { cursor: pointer; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(180px, 1fr)); gap: 12px; margin: 20px 0; }
.tile { background: #f4f6f8; border-radius: 8px; padding: 10px 14px; }
.tile b { display: block; font-size: 24px; font-weight: 600; } .tile span { color: #555; font-size: 13px; }
table { border-collapse: collapse; width: 100%; font-size: 14px; }
th { text-align: left; font-weight: 600; border-bottom: 2px solid #bbb; padding: 4px 10px 4px 0; }
td { border-bottom: 1px solid #e3e3e3; padding: 3px 10px 3px 0; vertical-align: top; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
svg { max-width: 100%; height: auto; display: block; }
i.swatch { display: inline-block; width: 12px; height: 12px; border-radius: 3px; margin-right: 8px; }
"""


@dataclass(frozen=True)
class Induction:
    """Everything that a report shows."""

    tree: Tree
    patterns: Patterns
    demonstrations: int
    source: str
    """Where the demonstrations came from."""
    method: str
    objective: str
    value: float
    """The value of the root according to the method [nat]: learned values may still be too high."""
    worth: float
    """The true value of the tree [nat]."""
    optimum: float
    """The value of the best tree of half-splits [nat]."""
    rmse: float | None
    """Held-out error [levels]."""
    training_rmse: float
    """Error on the training patterns [levels]."""
    curve: Sequence[float]
    """Root value after each trial; empty where there are no trials."""
    tried: Mapping[int, float]
    """Held-out error [levels] by number of leaves; empty where no size was chosen."""
    notes: Sequence[str] = ()
    """Further remarks on the data, a line each."""
    skill: SkillReport | None = None
    """How well the tree plays, where that was measured."""


def induction_page(induction: Induction) -> str:
    """The page."""
    tree = induction.tree
    title = f"{tree.behavior}: a decision tree with {counted(tree.leaf_count, 'leaf', 'leaves')}"
    text = tree_to_bytes(tree).decode()
    body = "\n".join(
        (
            f"<h1>{escape(title)}</h1>",
            f'<p class="quiet">Tree <code>{tree.hash}</code></p>',
            _tiles(induction),
            "<h2>The tree</h2>",
            "<p>Each rectangle is a leaf, in the color of what the robot does there; the dots are the patterns. "
            "Hover over a leaf to read its rule.</p>",
            partition_svg(tree, induction.patterns.x),
            *_skill(induction.skill),
            _course(induction),
            "<h2>Leaves</h2>",
            _leaves(tree),
            "<h2>Data</h2>",
            _data(induction),
            "<h2>Parameters</h2>",
            _table(("parameter", "value"), ((name, _value(value)) for name, value in sorted(tree.origin.items()))),
            "<h2>As JSON</h2>",
            "<p>The tree file: what the behavior's node reads, and the source of everything that this page shows of the tree.</p>",
            f"<details><summary>{len(text)} characters</summary><pre>{escape(text)}</pre></details>",
        )
    )
    head = f'<!doctype html>\n<html lang="en">\n<head><meta charset="utf-8"><title>{escape(title)}</title>'
    return f"{head}\n<style>{STYLE}</style></head>\n<body>\n{body}\n</body>\n</html>\n"


def _tiles(induction: Induction) -> str:
    rmse = induction.rmse
    held_out = ("n/a", "held-out error: needs two demonstrations")
    if rmse is not None and induction.tree.commands == WHEELS:
        held_out = (f"{rmse:.2f} levels", f"held-out error of the wheels, {rad_s_of(rmse):.1f} rad/s")
    elif rmse is not None:
        held_out = (f"{rmse:.2f} levels", "held-out error of the commands")
    worth = f"; the tree is worth {_nat(induction.worth)}, the best one {_nat(induction.optimum)}"
    tiles = (
        (str(induction.tree.leaf_count), "leaf" if induction.tree.leaf_count == 1 else "leaves"),
        (f"{len(induction.patterns)}", f"patterns of {counted(induction.demonstrations, 'demonstration')}"),
        held_out,
        (f"{induction.training_rmse:.2f} levels", "error on the training patterns"),
        (_nat(induction.value), f"value of the root ({induction.objective} objective){worth}"),
    )
    return '<div class="tiles">{}</div>'.format(
        "".join(f'<div class="tile"><b>{escape(value)}</b><span>{escape(name)}</span></div>' for value, name in tiles)
    )


def _skill(skill: SkillReport | None) -> Iterator[str]:
    """How well it plays, and what more to demonstrate."""
    if skill is None:
        return
    yield f"<h2>Skill</h2>\n<p>Each drove from the same {counted(skill.starts, 'start')}; lower is better.</p>"
    arrives = any(each.arrived is not None for each in skill.skills)
    heads = [
        "driver",
        skill.measure,
        "95 % interval",
        *(["arrived"] if arrives else []),
        "contact steps per 1000 steps",
    ]
    rows = [
        (
            each.driver,
            f"{each.cost.estimate:.1f}",
            f"{each.cost.low:.1f} to {each.cost.high:.1f}" if isfinite(each.cost.low) else "n/a",
            *([percent(each.arrived)] if each.arrived is not None else []),
            f"{each.contact_per_1000:.1f}",
        )
        for each in skill.skills
    ]
    yield _table(heads, rows, numbers=range(1, len(heads)))
    gaps = skill.coverage.gaps()
    if gaps:
        yield "<p>Demonstrate more of this, where it drove but nothing was demonstrated:</p>"
        yield _table(("where", "share of its driving"), ((gap.where, percent(gap.share)) for gap in gaps), numbers=(1,))
    yield coverage_svg(skill.coverage)


def _course(induction: Induction) -> str:
    """How the method arrived at its tree."""
    if induction.curve:
        points = [(float(trial), value) for trial, value in enumerate(induction.curve, start=1)]
        figure = curve_svg("Learning", points, "trial", "value of the root [nat]", ("optimum", induction.optimum))
        above = " It begins above that, because untried splits start with optimistic values."
        return (
            "<h2>Learning curve</h2>\n<p>The value of the root as learned after each trial. The dashed line is what "
            "dynamic programming finds over the same regions."
            f"{above if induction.curve[0] > induction.optimum else ''}</p>\n{figure}"
        )
    if induction.tried:
        points = [(float(leaves), error) for leaves, error in sorted(induction.tried.items())]
        figure = curve_svg("Cross-validation", points, "leaves", "held-out error [levels]", doubling=True)
        return f"<h2>Choice of size</h2>\n<p>The held-out error by number of leaves; the size with the smallest was taken.</p>\n{figure}"
    text = "The values were computed exactly, by dynamic programming: there is no learning curve."
    if induction.method == "cart":
        text = "CART grew the tree best split first, to the requested number of leaves; it may split at any value."
    return f"<h2>Method</h2>\n<p>{text}</p>"


def _leaves(tree: Tree) -> str:
    rows: list[Sequence[str | float]] = []
    swatches: list[str] = []
    form = ".1f" if tree.commands == WHEELS else ".3f"
    for rule in rules(tree):
        values = (f"{value:{form}}" for value in rule.leaf.command)
        rows.append((rule.leaf_id, rule.where, rule.what, *values, rule.leaf.patterns))
        swatches.append(_swatch(rule))
    axes = (f"{axis.name} [{axis.unit}]" for axis in tree.commands.axes)
    heads = ("leaf", "where", "what the robot does", *axes, "patterns")
    return _table(heads, rows, numbers=(0, *range(3, len(heads))), before=(2, swatches))


def _swatch(rule: Rule) -> str:
    return f'<i class="swatch" style="background:{COLOURS[rule.motion]};opacity:{OPACITY[rule.speed]}"></i>'


def _data(induction: Induction) -> str:
    patterns = induction.patterns
    classes = len(np.unique(patterns.wheel_class))
    about = (
        f"<p>{escape(induction.source)}: {counted(induction.demonstrations, 'demonstration')}, {len(patterns)} patterns of "
        f"{classes} {'wheel ' if induction.tree.commands == WHEELS else ''}classes. SHA-256 of the patterns: <code>{patterns.sha256}</code></p>"
    )
    rows = [
        (feature.name, _number(feature, feature.low), _number(feature, feature.high), *_seen(feature, column))
        for feature, column in zip(patterns.features, patterns.x.T, strict=True)
    ]
    heads = ("feature", "root region from", "to (exclusive)", "lowest pattern", "highest pattern")
    about += "".join(f"<p>{escape(note)}</p>" for note in induction.notes)
    return about + _table(heads, rows, numbers=(1, 2, 3, 4))


def _seen(feature: Feature, column: Any) -> tuple[str, str]:
    return _number(feature, float(column.min())), _number(feature, float(column.max()))


def _number(feature: Feature, value: float) -> str:
    return f"{degrees(value):.1f} degrees" if feature.unit == "rad" else f"{value:.3g} {feature.unit}".strip()


def _table(
    heads: Sequence[str],
    rows: Iterable[Sequence[object]],
    numbers: Sequence[int] = (),
    before: tuple[int, Sequence[str]] = (-1, ()),
) -> str:
    """A table. `numbers` are the columns that are flush right; `before` is a column and HTML in front of each cell of it."""

    def cell(tag: str, column: int, content: object, ahead: str = "") -> str:
        kind = ' class="number"' if column in numbers else ""
        return f"<{tag}{kind}>{ahead}{escape(str(content))}</{tag}>"

    lines = ["<tr>{}</tr>".format("".join(cell("th", k, head) for k, head in enumerate(heads)))]
    for index, row in enumerate(rows):
        cells = (cell("td", k, item, before[1][index] if k == before[0] else "") for k, item in enumerate(row))
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return "<table>\n{}\n</table>".format("\n".join(lines))


def _value(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _nat(value: float) -> str:
    return f"{value:.3f} nat" if isfinite(value) else "diverged"
