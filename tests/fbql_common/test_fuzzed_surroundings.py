"""Whatever the environment variables hold that our processes read: each is used, set aside in one line, or refused."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from fbql.cli.output import LiveLine
from fbql.graph.domains import MAX_DOMAIN_ID, domain_from
from fbql_common import spin
from fbql_common.core.errors import BadInput
from fbql_common.core.text import one_line
from fbql_common.middleware import ELSEWHERE, PROFILES, RANGE, prepare_middleware, prepare_node
from fbql_common.terminal.screen import trouble_with_terminal
from fuzzing import dice, odd_variable, read_or_refused

NAMES = (
    *ELSEWHERE, *PROFILES, RANGE, "RMW_IMPLEMENTATION", "ROS_LOCALHOST_ONLY", "ROS_SECURITY_ENABLE", "ROS_DOMAIN_ID",
    "ROS_LOG_DIR", "ROS_HOME", "HOME", "TMPDIR", "TERM", "COLUMNS", "LINES", "AMENT_PREFIX_PATH", "NO_COLOR",
)  # fmt: skip


def test_any_variables_keep_the_graph_here_or_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for number, rng in enumerate(dice(100)):
        with monkeypatch.context() as patch:
            for name in NAMES:
                patch.setenv(name, os.environ.get(name, ""))  # whatever is set or removed below is put back
            patch.setenv("ROS_LOG_DIR", str(tmp_path / "log"))
            odd = {rng.choice(NAMES): odd_variable(rng) for _ in range(rng.randrange(1, 6))}
            # The name of a host would be looked up, elsewhere.
            odd.update(
                {name: rng.choice(("127.0.0.1", ";;", "127.0.0.1:99999", "::1")) for name in ELSEWHERE if name in odd}
            )
            for name, value in odd.items():
                patch.setenv(name, value)
            said: list[str] = []
            try:
                rng.choice((prepare_middleware, prepare_node))(said.append)
            except BadInput as error:
                assert str(error).isprintable(), odd
                continue
            assert all(one_line(line) for line in said)
            if os.environ[RANGE] in ("LOCALHOST", "SYSTEM_DEFAULT") and odd.get(RANGE) is None:
                left = tuple(f"{name}=" for name in ELSEWHERE if os.environ.get(name))
                assert not left or all(line.startswith(left) and "is in force" in line for line in said), odd
            domain = read_or_refused(domain_from)
            assert domain is None or 0 <= domain <= MAX_DOMAIN_ID, (number, odd)
            trouble_with_terminal()
            LiveLine().show(odd_variable(rng))
            if not {"HOME", "ROS_HOME", "ROS_LOG_DIR"} & set(odd) or rng.random() < 0.3:
                patch.chdir(tmp_path)
                read_or_refused(spin._ensure_log_directory)
