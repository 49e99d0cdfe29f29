"""The report of a run: one self-contained HTML page that makes no network request.

Its security policy makes the browser enforce this: no request is allowed, and no script but the page's own runs.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from string import Template
from tempfile import TemporaryFile
from typing import Any, TextIO

from fbql_behaviors.core.tree import Tree
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import from_mapping
from fbql_fusion.core.parameters import FusionParameters
from fbql_recording.core.episodes import Episode
from fbql_recording.run import Run

from fbql.cli.words import percent
from fbql.report.contents import UNIT, Contents, counted, page_data, read_contents
from fbql.report.texts import CONTROLLERS, FEATURES, NOT_AVAILABLE, html, json_for_html, table, value_text

ASSETS = Path(__file__).parent / "assets"
_PROGRAM = ("data.js", "surface.js", "field.js", "moment.js", "timelines.js", "player.js", "main.js")
"""In the order of their dependencies; behind them comes what starts the page."""
_WITHOUT_SCRIPT = (
    '\n<noscript><p class="trouble">The tables below can be read without JavaScript; the field and the timelines need it.'
    "</p></noscript>"
)
OUTCOMES = {"goal": ("●", "goal"), "own_goal": ("✕", "own goal"), "timeout": ("◆", "timeout")}
"""A sign and a word: never a color alone."""


def write_page(run: Run, out: TextIO, progress: Callable[[int], None]) -> Contents:
    """Writes the report of a run. The steps are read once, and pass through a temporary file.

    Args:
        out: where the page is written.
        progress: called now and then with the number of steps read; what it raises ends the writing.

    Raises:
        BadInput: the run has no steps; `Corrupt`.
    """
    with TemporaryFile("w+", encoding="ascii") as blocks:
        contents = read_contents(run, blocks, progress)
        before, after = filled(
            "start.js",
            title=html(run.path.resolve().name),  # `.` has a name too
            headline=_headline(contents),
            tiles=tiles(contents),
            notes=_warnings(contents) + _WITHOUT_SCRIPT,
            senses=senses(contents.trees.values()),
            controllers=_controllers(contents),
            episodes=_episodes(contents),
            about=_about(contents, file_digests(run)),
            data=json_for_html(page_data(contents, contents.blocks)),
            blocks="\0",
        ).split("\0")
        out.write(before)
        blocks.seek(0)
        for line in blocks:
            out.write(f'<script type="text/plain" class="block">{line.rstrip()}</script>\n')
        out.write(after)
    return contents


def filled(start: str, connect: str = "", **parts: str) -> str:
    """The page with its parts, which are HTML already.

    Args:
        start: the script in `assets` that starts the page.
        connect: the only address that the page may connect to, if there is one.
        parts: what fills the template, by name.
    """
    style = (ASSETS / "page.css").read_text(encoding="utf-8")
    program = "\n".join((ASSETS / name).read_text(encoding="utf-8") for name in (*_PROGRAM, start))
    program = f'(() => {{\n"use strict";\n{program}\n}})();'
    policy = f"default-src 'none'; img-src data:; style-src '{source_hash(style)}'; script-src '{source_hash(program)}'"
    policy += f"; connect-src {connect}" if connect else ""
    template = Template((ASSETS / "page.html").read_text(encoding="utf-8"))
    return template.substitute(parts, policy=policy, style=style, program=program)


def source_hash(text: str) -> str:
    """A script's or style's hash as a security policy writes it."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def _headline(contents: Contents) -> str:
    parameters = contents.run.parameters.get("fusion", {})
    parts = [", ".join(contents.controllers) or "controller n/a"]
    seed = parameters.get("seed") if isinstance(parameters, dict) else None
    parts.append(f"seed {seed if isinstance(seed, int) else 'n/a'}")
    parts.append(f"{contents.steps} steps in {len(contents.episodes)} episodes")
    return html(" · ".join(parts))


def tiles(contents: Contents) -> str:
    """The result in numbers, counted from the recording."""
    return tiles_html(tile_values(contents.episodes))


def tiles_html(values: Iterable[tuple[str, str, str]]) -> str:
    """The tiles with these names, values and notes."""
    parts = [f"<li><b>{value}</b> {name}<small>{note}</small></li>" for name, value, note in values]
    return f'<ul class="tiles">{"".join(parts)}</ul>'


def tile_values(all_episodes: Sequence[Episode]) -> list[tuple[str, str, str]]:
    """The result of some episodes: name, value and note of each number."""
    episodes = counted(all_episodes)
    outcomes = [episode.outcome for episode in episodes]
    known = any(outcomes) or not episodes
    goals = outcomes.count("goal")
    steps = sum(episode.steps for episode in episodes)
    guided = len(all_episodes) - len(episodes)

    def number(outcome: str) -> str:
        return f"{outcomes.count(outcome)}" if known else NOT_AVAILABLE

    return [
        ("episodes", f"{len(episodes)}", f"and {guided} guided, not counted" if guided else ""),
        ("goals", number("goal"), f"{percent(goals / len(episodes))} of the episodes" if any(outcomes) else ""),
        ("own goals", number("own_goal"), ""),
        ("timeouts", number("timeout"), ""),
        ("steps per goal", f"{steps / goals:.0f}" if goals else NOT_AVAILABLE, "of all episodes"),
        ("collisions", _sum([episode.collisions_begun for episode in episodes]), "with a wall"),
    ]


def _sum(values: list[int | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{sum(known)}" if known or not values else NOT_AVAILABLE


def _warnings(contents: Contents) -> str:
    """The problems of the recording; empty if it is complete."""
    lines = [*contents.run.warnings, *contents.notes]
    if not lines:
        return ""
    items = "".join(f"<li>{html(line)}</li>" for line in lines)
    return f'<section class="warnings" role="note"><h2>⚠ This recording is incomplete</h2><ul>{items}</ul></section>'


def _controllers(contents: Contents) -> str:
    """The controllers of the run in words, and what triggers the layers of Subsumption."""
    parts = [controllers_html(contents.controllers)]
    guided = any(episode.phase == "guided" for episode in contents.episodes)
    if guided:
        parts.append("<p>In <b>guided</b> episodes Subsumption drives, and the controller learns from it.</p>")
    if guided or "subsumption" in contents.controllers:
        parts.append(_layers(contents.run))
    return "\n".join(parts)


def controllers_html(names: Iterable[str]) -> str:
    """These controllers in words, if they belong to this project."""
    return "\n".join(f"<p><b>{html(name)}.</b> {html(CONTROLLERS[name])}</p>" for name in names if name in CONTROLLERS)


def senses(trees: Iterable[Tree]) -> str:
    """The meaning of the features in the rules, if they belong to this project."""
    names = {feature.name for tree in trees for feature in tree.features}
    known = [
        f"<div><dt>{name.replace('_', ' ')}</dt><dd>{FEATURES[name]}</dd></div>" for name in FEATURES if name in names
    ]
    return (
        f'<p>What they sense; left and right are as the robot sees it:</p><dl class="senses">{"".join(known)}</dl>'
        if known
        else ""
    )


def _layers(run: Run) -> str:
    found = run.parameters.get("fusion", {})
    names = ("behaviors", "layers", "preset", "wall_threshold_m", "approach_threshold_rad")
    try:
        values = {name: found[name] for name in names if name in found}
        parameters = from_mapping(FusionParameters, values, "config.yaml")
        wall_m, approach_rad = parameters.thresholds
    except (BadInput, TypeError, ValueError, KeyError):
        return ""
    triggers = {
        "wall_avoiding": f"the wall is nearer than {wall_m:.4g} m",
        "approaching": f"the ball-to-goal line is more than {approach_rad:.4g} rad ({_degrees(approach_rad)}) off",
    }
    layers = [
        f"<li>{html(name)}: when {triggers.get(name, 'its observation lies inside the root region of its tree')}</li>"
        for name in parameters.layers
        if name in parameters.behaviors
    ]
    return f"<p>The layers of Subsumption; the first one that is triggered drives:</p><ol>{''.join(layers)}</ol>"


def _degrees(rad: float) -> str:
    return f"{rad * 57.29577951308232:.1f}°"


def _episodes(contents: Contents) -> str:
    """Every episode; its number is a button that goes there."""
    head = ("episode", "phase", "outcome", "steps", "collisions", "steps in contact", "return", "seed")
    rows = [_episode_row(index, episode) for index, episode in enumerate(contents.episodes)]
    listed = table("Every episode of the recording", head, rows, (3, 4, 5, 6, 7))
    shown = f'<div class="scrolls" tabindex="0" role="region" aria-label="Table of the episodes">{listed}</div>'
    return f"<section><h2>Episodes</h2>\n{shown}\n</section>"


def _episode_row(place: int, episode: Episode) -> list[str]:
    sign, word = OUTCOMES.get(episode.outcome or "", ("–", NOT_AVAILABLE))
    number = f'<button type="button" class="link" data-episode="{place}">{episode.index}</button>'
    degraded = ' <abbr title="a step or an answer was missing: not all of it could be learned from">degraded</abbr>'
    return_ = NOT_AVAILABLE if episode.return_ is None else f"{episode.return_:.4g}"
    return [
        number,
        html(value_text(episode.phase)) + (degraded if episode.degraded else ""),
        f"{sign} {word}",
        f"{episode.steps}",
        value_text(episode.collisions_begun),
        value_text(episode.collision_steps),
        return_,
        value_text(episode.seed),
    ]


def _about(contents: Contents, digests: Mapping[str, str]) -> str:
    """The origin of the run: versions, hashes, every parameter.

    Args:
        digests: SHA-256 by the name of each file.
    """
    run = contents.run
    summary = run.summary or {}
    facts: list[tuple[str, Any]] = [
        ("digest of every step", summary.get("digest")),
        ("git revision", run.config.get("git_revision")),
        *((f"version of {name}", version) for name, version in mapping(run.config.get("versions")).items()),
        ("steps in the recording", contents.steps),
        ("complete", run.is_complete),
    ]
    parts = [facts_table("Origin", facts)]
    parts.append(facts_table("SHA-256 of the files", digests.items(), code=True))
    parts.append(
        facts_table("Hashes of the trees", ((_tree_name(contents, each), each) for each in contents.tree_hashes), True)
    )
    parts.append(facts_table("Messages recorded", run.counts.items()))
    for node, parameters in run.parameters.items():
        parts.append(facts_table(f"Parameters of {html(node)}", mapping(parameters).items()))
    if not run.parameters:
        parts.append(f"<p>Parameters: {NOT_AVAILABLE}, the recording has none.</p>")
    return f"<section><h2>The run</h2>\n{_precision()}\n{'\n'.join(parts)}\n</section>"


def file_digests(run: Run) -> dict[str, str]:
    """SHA-256 of the recording's files and of what is attached in it."""
    digests: dict[str, str] = {}
    for path in run.files:
        with path.open("rb") as file:
            digests[path.name] = hashlib.file_digest(file, "sha256").hexdigest()
    return digests | {name: hashlib.sha256(data).hexdigest() for name, data in run.attachments.items()}


def _tree_name(contents: Contents, tree_hash: str) -> str:
    tree = contents.trees.get(tree_hash)
    return f"{tree.behavior}, {tree.leaf_count} leaves" if tree is not None else "not in the recording"


def facts_table(caption: str, facts: Iterable[tuple[str, Any]], code: bool = False) -> str:
    rows = [
        (html(name), f"<code>{html(value_text(value))}</code>" if code else html(value_text(value)))
        for name, value in facts
    ]
    if not rows:
        return ""
    return f"<details><summary>{caption}</summary>{table(caption, ('name', 'value'), rows)}</details>"


def mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _precision() -> str:
    """How the numbers on the page are rounded."""
    return (
        f"<p>Numbers on this page come from the recording, rounded to 0.1 mm, 0.1 mm/s, {UNIT:g} rad, {UNIT:g} rad/s, "
        f"{UNIT:g} of a weight and 0.1 ms; Q and rewards to 7 digits. Anything that was not recorded is {NOT_AVAILABLE}. The "
        "arrows in the field, where the robot would go in the next quarter of a second, are computed from the wheel velocities. "
        "The field's lines and the sizes of robot and ball are those of the project that wrote this page.</p>"
    )
