"""What a person sees: a live line on a terminal, a line now and then elsewhere, and a result in words."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from bringup_run import Run, Terminal
from fbql.cli import output
from fbql.cli.output import LiveLine
from fbql.match.options import match_from, match_parser, policy_summary
from fbql.match.result import Asked, next_steps, status_line, summary_text
from run_directory_reader import summary_of

Start = Callable[..., Run]
STATUS = {
    "episode": "17",
    "phase": "evaluation",
    "step": "547",
    "goals": "15",
    "own_goals": "1",
    "timeouts": "2",
    "steps_per_s": "1112",
    "weights": "ball_seeking 0.00 wall_avoiding 1.00 approaching 0.00",
}
SUMMARY: Mapping[str, Any] = {
    "controller": "subsumption", "seed": 7, "episodes": 4, "goals": 3, "own_goals": 0, "timeouts": 1,
    "success_rate": 0.75, "cost_per_goal": 2000.0, "mean_steps_per_goal": 660.0, "collisions_begun": 5,
    "collision_steps": 21, "steps": 6000, "wall_s": 4.0, "steps_per_s": 1500.0, "digest": "ab" * 32,
    "messages_recorded": 36024, "incomplete": False,
}  # fmt: skip


@pytest.mark.parametrize("columns", [80, 120])
def test_a_terminal_has_one_live_line_that_never_wraps_and_stdout_only_the_result(start: Start, columns: int) -> None:
    terminal = Terminal(columns)
    match = ("--controller", "subsumption", "--episodes", "6", "--seed", "7")
    run = start(*match, "--processes", "one", "--json", terminal=terminal)
    assert run.exit_code() == 0, terminal.shown
    assert json.loads(run.stdout) == summary_of(run.out)
    begin, live, after = terminal.lines()
    terminal.close()
    assert begin[0].startswith("bringing up 5 nodes")
    assert after == [""]
    shown = [state for state in live if state]
    assert len(shown) > 2
    weight = r"\d\.\d\d"
    weights = (
        f"ball_seeking {weight} wall_avoiding {weight} approaching {weight}"
        if columns == 120
        else " ".join([weight] * 3)
    )
    for state in shown:
        assert len(state) < columns - 2
        assert re.match(r"episode \d · \d goals, \d own, \d timeouts · \d+ steps/s · ", state)
        assert re.search(f"{weights} *$", state)


def test_elsewhere_a_line_now_and_then_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(output, "monotonic", lambda: now[0])
    stream = StringIO()
    shown = LiveLine(stream, log_every_s=10.0)
    for _ in range(4 * 35):
        now[0] += 0.25
        shown.show(partial(status_line, STATUS))
    assert stream.getvalue() == f"{status_line(STATUS)}\n" * 3


FULL = len(status_line(STATUS))


@pytest.mark.parametrize(
    ("width", "contains"),
    [
        (FULL, "episode 17 (evaluation) · step 547 · 15 goals, 1 own goals, 2 timeouts · 1112 steps/s · weights ball"),
        (FULL - 1, "15 goals, 1 own, 2 timeouts · 1112 steps/s · weights ball_seeking 0.00 wall_avoiding 1.00"),
        (117, "1112 steps/s · ball_seeking 0.00 wall_avoiding 1.00 approaching 0.00"),
        (80, "1112 steps/s · weights 0.00 1.00 0.00"),
        (77, "1112 steps/s · 0.00 1.00 0.00"),
        (40, "episode 17 · 15 goals, 1 own, 2"),
    ],
)
def test_the_live_line_is_the_longest_form_that_fits(width: int, contains: str) -> None:
    line = status_line(STATUS, width)
    assert len(line) <= width
    assert contains in line


def test_a_controller_without_weights_yet_is_shown() -> None:
    assert "episode 17" in status_line({**STATUS, "weights": ""}, 80)


def test_a_result_is_told_in_lines_that_fit_a_terminal(tmp_path: Path) -> None:
    text = summary_text(SUMMARY, Path("/run"), 1 / 60)
    assert "subsumption, seed 7: 3 goals in 4 episodes, success rate 75 %" in text
    assert "660  steps on average, 11.0 s of play" in text
    assert "2000  steps of all episodes, per goal" in text
    assert "6000  steps in 4.0 s: 1500 steps/s, 25 times real time" in text
    assert "36024  messages in /run" in text
    assert max(map(len, text.splitlines())) < 80
    assert "INCOMPLETE" in summary_text({**SUMMARY, "incomplete": True}, Path("/run"), 1 / 60)


@pytest.mark.parametrize(
    ("asked", "after"),
    [
        (Asked(episodes=9), "4 of 9 episodes, 3 goals"),
        (Asked(goals=9), "3 of 9 goals"),
        (Asked(episodes=9, goals=9), "4 of 9 episodes and 3 of 9 goals"),
    ],
)
def test_a_match_that_ended_early_tells_each_count_once(asked: Asked, after: str) -> None:
    assert f"ENDED EARLY after {after}\n" in summary_text(SUMMARY, Path("/run"), 1 / 60, asked=asked)


def test_guided_episodes_are_told_apart_from_what_they_count_in(tmp_path: Path) -> None:
    (tmp_path / "episodes.csv").write_text("index,phase\n0,guided\n1,guided\n2,learning\n")
    text = summary_text(SUMMARY, tmp_path, 1 / 60).splitlines()
    (at,) = [i for i, line in enumerate(text) if line.startswith("  guided              2  episodes first")]
    assert text[at + 1].startswith("  played") and text[at + 2].startswith("  digest")
    assert max(map(len, text[at : at + 2])) < 80


def test_a_result_names_the_policy_that_it_began_from(tmp_path: Path) -> None:
    def told(*words: str) -> str:
        options = match_parser("bringup.py", "").parse_args([*words, "--out", "/run"])
        return summary_text(SUMMARY, Path("/run"), 1 / 60, policy_summary(match_from(options)))

    assert "  policy        shipped  which it started from; --policy none starts untrained\n" in told()
    assert "  policy           none  it started untrained\n" in told("--policy", "none")
    own = tmp_path / "mine.npz"
    own.touch()
    assert f"  policy          given  which it started from: {own}\n" in told("--policy", str(own))
    assert "policy" not in told("--controller", "subsumption")


def test_a_result_of_nothing_is_told_without_numbers() -> None:
    nothing = dict.fromkeys(("success_rate", "cost_per_goal", "mean_steps_per_goal", "wall_s", "steps_per_s"))
    zero = dict.fromkeys(("episodes", "goals", "timeouts", "steps", "messages_recorded"), 0)
    text = summary_text({**SUMMARY, **nothing, **zero}, Path("/run"), 1 / 60)
    assert "0 goals in 0 episodes\n" in text
    assert text.count("n/a") == 2
    assert "none  the other files are in /run" in text


def test_what_to_type_next_goes_on_with_what_was_learned(tmp_path: Path) -> None:
    assert "python3 scripts/bringup.py\n" in next_steps(SUMMARY, tmp_path)
    assert f"ros2 bag info {tmp_path}" in next_steps(SUMMARY, tmp_path)
    assert f"scripts/report.py {tmp_path}" in next_steps(SUMMARY, tmp_path)
    assert "report.py" not in next_steps({**SUMMARY, "messages_recorded": 0}, tmp_path)
    for nothing_whole in ({"messages_recorded": 0}, {"incomplete": True}):
        assert "ros2 bag" not in next_steps({**SUMMARY, **nothing_whole}, tmp_path)
    assert f"scripts/recover.py {tmp_path}" in next_steps({**SUMMARY, "incomplete": True}, tmp_path)
    assert "recover.py" not in next_steps(SUMMARY, tmp_path)
    own = next_steps(SUMMARY, tmp_path, " --trees mine")
    assert "bringup.py --trees mine --policy none\n      the same behaviors, and fbql learns to fuse them" in own
    assert "bringup.py --trees mine --controller subsumption --realtime 1" in own
    spaced = tmp_path / "a run"
    spaced.mkdir()
    (spaced / "policy.npz").touch()
    assert next_steps(SUMMARY, spaced).count(f"'{spaced}'") == 2, "report.py and ros2 bag"
    assert next_steps(SUMMARY, spaced).count(f"--policy '{spaced}/policy.npz'") == 3
    for domain_id in (None, 7):
        commands = [
            line for line in next_steps(SUMMARY, tmp_path, domain_id=domain_id).splitlines() if line[2:3] != " "
        ]
        assert commands[-1] == "  python3 scripts/bringup.py --controller subsumption --watch terminal --goals 3"
        told = "  export ROS_DOMAIN_ID=7 ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST" in commands
        assert told is (domain_id is not None)
    (tmp_path / "policy.npz").touch()
    again = next_steps(SUMMARY, tmp_path, " --trees mine")
    assert f"python3 scripts/bringup.py --trees mine --controller {SUMMARY['controller']} --policy" in again
    assert "continue from the learned policy" in again
    frozen = next_steps(SUMMARY, tmp_path, "", learn=False)
    assert "continue learning from the policy that was played" in frozen
    assert f"--policy {tmp_path}/policy.npz --no-learn --realtime 1" in frozen
    learned = next_steps({**SUMMARY, "controller": "fbql_literal"}, tmp_path)
    assert f"--controller fbql_literal --policy {tmp_path}/policy.npz" in learned


def test_a_match_in_real_time_tells_how_many_ticks_it_missed() -> None:
    assert "  missed" not in summary_text(SUMMARY, Path("/run"), 1 / 60)
    slow = summary_text({**SUMMARY, "missed_ticks": 408}, Path("/run"), 1 / 60)
    assert "  missed            408  ticks of real time: the machine was too slow" in slow
    kept = summary_text({**SUMMARY, "missed_ticks": 0}, Path("/run"), 1 / 60)
    assert "  missed              0  ticks: the simulator kept real time" in kept
    assert "unseen" not in kept
    unknown = summary_text({**SUMMARY, "missed_ticks": None}, Path("/run"), 1 / 60)
    assert "  missed            n/a  ticks: the simulator's count did not arrive" in unknown


def test_a_match_tells_how_many_steps_fusion_did_not_see() -> None:
    unseen = summary_text({**SUMMARY, "missed_ticks": 0, "steps_unseen": 81}, Path("/run"), 1 / 60)
    assert "  unseen             81  of these steps never reached fusion" in unseen


def test_what_to_type_next_names_the_domain_of_the_graph(tmp_path: Path) -> None:
    assert "  export ROS_DOMAIN_ID=7 " in next_steps(SUMMARY, tmp_path, domain_id=7)
    assert "ROS_DOMAIN_ID" not in next_steps(SUMMARY, tmp_path)
