"""What is shown of a process that ended a graph."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from fbql.graph.processes import start
from fbql.graph.supervision import GraphFailed


@pytest.mark.parametrize(
    ("program", "shown"),
    [
        ("print('no room'); raise SystemExit(1)", "no room"),
        ("print('no room'); import os; os.abort()", "no room"),
        ("raise KeyboardInterrupt", ""),  # as Python ends on SIGINT while it imports: with a traceback
    ],
)
def test_the_output_of_a_process_is_shown_unless_sigint_ended_its_loading(
    tmp_path: Path, program: str, shown: str
) -> None:
    process = start("node", [sys.executable, "-u", "-c", program], dict(os.environ), tmp_path)
    process.popen.wait()
    assert process.log_file.read_bytes()
    assert GraphFailed("it ended", process).output == shown
