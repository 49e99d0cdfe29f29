"""The report of a run of a mux: one self-contained HTML page that makes no network request and runs no script."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TextIO

from fbql_common.core.cdr import Malformed
from fbql_common.core.errors import BadInput
from fbql_common.core.mux_types import MuxDecision
from fbql_common.core.types import Phase
from fbql_fusion.core.tasks.twist.task import FAILURE
from fbql_recording.core.decoding import MUX_DECISION, MessageCodec
from fbql_recording.core.metrics import SUCCESS, TIMEOUT
from fbql_recording.mcap.reader import Corrupt
from fbql_recording.run import Run

from fbql.cli.words import counted, percent
from fbql.report.page import ASSETS, facts_table, file_digests, mapping, source_hash, tiles_html
from fbql.report.texts import NOT_AVAILABLE, html, table

SIGNS = {SUCCESS: "●", TIMEOUT: "◆"}
"""A sign and a word: never a color alone. Every other outcome is a failure."""
NOBODY = "nobody, or a blend"
_GUIDED = Phase.GUIDED.name.lower()
_PROGRESS_STEPS = 4096
_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src '{hash}'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}: who drove</title>
<link rel="icon" href="data:,">
<style>{style}</style>
</head>
<body>
<header>
<h1>{title}</h1>
<p class="quiet">{headline}</p>
{tiles}
</header>
{body}
</body>
</html>
"""


@dataclass
class DrivenEpisode:
    """An episode of a mux, counted from its decisions."""

    index: int
    phase: str
    outcome: str = NOT_AVAILABLE
    return_: float = 0.0
    drove: Counter[str] = field(default_factory=Counter[str])
    """Numbers of decisions by who drove after them."""

    @property
    def steps(self) -> int:
        """Number of decisions after which somebody drove."""
        return self.drove.total()


def read_episodes(run: Run, progress: Callable[[int], None] = lambda _: None) -> list[DrivenEpisode]:
    """The episodes of a recording of a mux, in which the last may have no end. Raises BadInput and Corrupt."""
    (topic, *_) = [topic for topic in run.topics.values() if topic.type_name == MUX_DECISION]
    codec = MessageCodec[MuxDecision](MUX_DECISION, topic.schema)
    episodes: list[DrivenEpisode] = []
    for count, message in enumerate(run.messages([topic.name])):
        try:
            decision = codec.decode(message.data)
        except Malformed as error:
            raise Corrupt(f"{run.path}: decision {count} (at {message.log_time_ns / 1e9:.3f} s): {error}") from None
        if not episodes or episodes[-1].index != decision.episode:
            phase = Phase(decision.phase).name.lower() if decision.phase in set(Phase) else f"{decision.phase}"
            episodes.append(DrivenEpisode(decision.episode, phase))
        episode = episodes[-1]
        episode.return_ += decision.reward
        if decision.terminated or decision.truncated:
            episode.outcome = (decision.outcome or FAILURE) if decision.terminated else TIMEOUT
        else:
            driver = decision.driver
            episode.drove[decision.behaviors[driver] if 0 <= driver < len(decision.behaviors) else NOBODY] += 1
        if count % _PROGRESS_STEPS == 0:
            progress(count)
    if not episodes:
        raise BadInput(f"{run.path}: it holds no decision")
    return episodes


def write_mux_page(
    run: Run, out: TextIO, progress: Callable[[int], None] = lambda _: None, picture: bytes = b""
) -> list[DrivenEpisode]:
    """Writes the report of a run of a mux.

    Args:
        out: where the page is written.
        progress: called now and then with the number of decisions read; what it raises ends the writing.
        picture: a PNG of where the robot drove, if there is one.

    Raises:
        BadInput: the run has no decisions; `Corrupt`.
    """
    episodes = read_episodes(run, progress)
    steps = sum(episode.steps for episode in episodes)
    about = run.about
    headline = f"{about.get('controller', NOT_AVAILABLE)} · seed {about.get('seed', NOT_AVAILABLE)} · "
    headline += f"{counted(steps, 'decision')} in {counted(len(episodes), 'episode')}"
    style = (ASSETS / "page.css").read_text(encoding="utf-8")
    shown = base64.b64encode(picture).decode()
    parts = (
        _warnings(run),
        f'<section><h2>Where it drove</h2>\n<img src="data:image/png;base64,{shown}" alt="Trails, colored by who drove">'
        "</section>"
        if picture
        else "",
        _drivers(episodes),
        _episodes(episodes),
        _about(run),
    )
    out.write(
        _PAGE.format(
            hash=source_hash(style),
            title=html(run.path.resolve().name),
            style=style,
            headline=html(headline),
            tiles=_tiles(episodes),
            body="\n".join(part for part in parts if part),
        )
    )
    return episodes


def _tiles(all_episodes: list[DrivenEpisode]) -> str:
    """The result of the episodes that count, as in a summary: all but the guided ones."""
    episodes = [episode for episode in all_episodes if episode.phase != _GUIDED]
    guided = len(all_episodes) - len(episodes)
    outcomes = Counter(episode.outcome for episode in episodes)
    steps, reached = sum(episode.steps for episode in episodes), outcomes[SUCCESS]
    ended = outcomes.total() - outcomes[NOT_AVAILABLE]
    rate = f"{percent(reached / ended)} of the episodes" if ended else ""
    others = (SUCCESS, TIMEOUT, NOT_AVAILABLE)
    failures = [f"{html(name)}: {count}" for name, count in outcomes.items() if name not in others]
    return tiles_html(
        [
            ("episodes", f"{len(episodes)}", f"and {guided} guided, not counted" if guided else ""),
            ("successes", f"{reached}", rate),
            ("failures", f"{ended - reached - outcomes[TIMEOUT]}", ", ".join(failures)),
            ("timeouts", f"{outcomes[TIMEOUT]}", ""),
            ("decisions per success", f"{steps / reached:.0f}" if reached else NOT_AVAILABLE, "of all episodes"),
        ]
    )


def _drivers(episodes: list[DrivenEpisode]) -> str:
    """The share of each source, in all episodes and in those of each outcome."""
    drove: Counter[str] = Counter()
    by_outcome: dict[str, Counter[str]] = {}
    for episode in episodes:
        drove += episode.drove
        by_outcome.setdefault(episode.outcome, Counter()).update(episode.drove)
    outcomes = sorted(by_outcome, key=lambda name: (name != SUCCESS, name))
    rows = [
        [html(name), _share(count, drove), *(_share(by_outcome[each][name], by_outcome[each]) for each in outcomes)]
        for name, count in drove.most_common()
    ]
    head = ("source", "all episodes", *map(_outcome, outcomes))
    shown = table("Share of the time that each source drove", head, rows, range(1, len(head)))
    return f"<section><h2>Who drove</h2>\n{shown}\n</section>"


def _share(count: int, of: Counter[str]) -> str:
    return percent(count / of.total()) if of.total() else NOT_AVAILABLE


def _outcome(name: str) -> str:
    return f"{'–' if name == NOT_AVAILABLE else SIGNS.get(name, '✕')} {html(name)}"


def _episodes(episodes: list[DrivenEpisode]) -> str:
    rows = [
        [
            f"{episode.index}",
            html(episode.phase),
            _outcome(episode.outcome),
            f"{episode.steps}",
            f"{episode.return_:.4g}",
            ", ".join(f"{html(name)} {_share(count, episode.drove)}" for name, count in episode.drove.most_common()),
        ]
        for episode in episodes
    ]
    head = ("episode", "phase", "outcome", "decisions", "return", "who drove")
    listed = table("Every episode of the recording", head, rows, (0, 3, 4))
    shown = f'<div class="scrolls" tabindex="0" role="region" aria-label="Table of the episodes">{listed}</div>'
    return f"<section><h2>Episodes</h2>\n{shown}\n</section>"


def _warnings(run: Run) -> str:
    items = "".join(f"<li>{html(line)}</li>" for line in run.warnings)
    heading = "<h2>⚠ This recording is incomplete</h2>"
    return items and f'<section class="warnings" role="note">{heading}<ul>{items}</ul></section>'


def _about(run: Run) -> str:
    origin = [
        ("digest of every decision", (run.summary or {}).get("digest")),
        ("git revision", run.config.get("git_revision")),
        *((f"version of {name}", version) for name, version in mapping(run.config.get("versions")).items()),
        ("complete", run.is_complete),
    ]
    parts = [
        facts_table("Origin", origin),
        facts_table("SHA-256 of the files", file_digests(run).items(), code=True),
        facts_table("Messages recorded", run.counts.items()),
        *(
            facts_table(f"Parameters of {html(node)}", mapping(values).items())
            for node, values in run.parameters.items()
        ),
    ]
    return f"<section><h2>The run</h2>\n{'\n'.join(parts)}\n</section>"
