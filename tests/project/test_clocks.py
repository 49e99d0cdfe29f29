"""Nothing that waits, times out or steps reads the wall clock: it may be set back, by hours."""

import ast
from pathlib import Path

import pytest
from places import ROOT

PACKAGES = ROOT / "ros2_ws" / "src"
NAMES_OF_DIRECTORIES = {"fbql/cli/places.py", "fbql/match/options.py", "fbql_fusion/run_recorder.py"}
"""They put the date into a name."""
RECEPTIONS = {"fbql_common/reception.py"}
"""It converts the middleware's stamps of reception, which are by the wall clock, to the steady clock."""
STAMPS = {
    "fbql_behaviors/teleop_node.py",
    "fbql_common/watch.py",
    "fbql_fusion/mux_learning.py",
    "fbql_fusion/status.py",
    "fbql_behaviors/twist_behavior_node.py",
    "fbql_fusion/twist_mux_node.py",
    "fbql_sim/views.py",
}
"""They read a node's clock: for the stamp of a message, and for simulated time."""
FILES = sorted(path for path in PACKAGES.glob("fbql*/fbql*/**/*.py") if "build" not in path.parts)


def short(path: Path) -> str:
    return str(path.relative_to(PACKAGES)).partition("/")[2]


def calls(path: Path) -> list[ast.Call]:
    return [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]


def name_of(call: ast.Call) -> str:
    return ast.unparse(call.func)


@pytest.mark.parametrize("path", FILES, ids=short)
def test_the_wall_clock_is_read_for_names_and_stamps_alone(path: Path) -> None:
    wall = {"time.time", "time", "time_ns", "time.time_ns", "datetime.now", "datetime.utcnow", "date.today"}
    used = {name_of(call) for call in calls(path)} & wall
    dates = {"datetime.now"} if short(path) in NAMES_OF_DIRECTORIES else set()
    assert used <= ({"time_ns"} if short(path) in RECEPTIONS else dates)
    if short(path) not in STAMPS | RECEPTIONS:
        assert not [call for call in calls(path) if name_of(call).endswith("get_clock")]


@pytest.mark.parametrize("path", FILES, ids=short)
def test_every_timer_and_every_throttle_has_the_steady_clock(path: Path) -> None:
    for call in calls(path):
        keywords = {keyword.arg for keyword in call.keywords}
        if name_of(call).endswith("create_timer"):
            assert "clock" in keywords, ast.unparse(call)
        if "throttle_duration_sec" in keywords:
            assert "throttle_time_source_type" in keywords, ast.unparse(call)
        if "clock_type" in keywords:
            assert "STEADY_TIME" in ast.unparse(call)
