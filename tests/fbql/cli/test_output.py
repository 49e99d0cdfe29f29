"""A result goes to stdout, and nothing else does; all that is printed is whole printable lines in the stream's encoding."""

from __future__ import annotations

import io
import math
import os
import pty
import subprocess
import sys
from collections.abc import Callable

import pytest
from fbql.cli.output import LiveLine, complain, json_text, print_result, say, warn
from fbql.cli.parser import Parser
from fuzzing import finite_json

FORGED = "x\nfbql: all is well\x1b[2J\u202e\ud800\r"
SHOWN = "x\\nfbql: all is well\\x1b[2J\\u202e\\ud800\\r"


@pytest.mark.parametrize(
    "show",
    [
        lambda: say(FORGED),
        lambda: complain(FORGED),
        lambda: warn([FORGED]),
        lambda: LiveLine(log_every_s=0.0).show(FORGED),
        lambda: LiveLine(log_every_s=0.0).show(lambda _width: FORGED),
        lambda: LiveLine().say(FORGED),
        lambda: LiveLine().complain(FORGED),
    ],
)
def test_a_line_on_stderr_stays_one_line(show: Callable[[], None], capsys: pytest.CaptureFixture[str]) -> None:
    show()
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert SHOWN in err


def test_a_result_has_only_the_lines_that_are_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    print_result("a\x1b[31m\nb\u202e\r")
    assert capsys.readouterr().out == "a\\x1b[31m\nb\\u202e\\r\n"


def test_a_result_in_json_has_null_for_a_number_that_json_lacks() -> None:
    values = {"nan": math.nan, "inside": [1, (-math.inf, 0.1 + 0.2), {"x": math.inf}], "text": "NaN", "none": None}
    assert finite_json(json_text(values)) == {
        "nan": None,
        "inside": [1, [None, 0.1 + 0.2], {"x": None}],
        "text": "NaN",
        "none": None,
    }


def test_a_live_line_on_a_terminal_is_escaped() -> None:
    master, slave = pty.openpty()
    with os.fdopen(slave, "w") as terminal:
        LiveLine(terminal).show(FORGED)
        shown = os.read(master, 1000).decode()
    os.close(master)
    assert shown == f"\r{SHOWN}"


@pytest.mark.parametrize(
    "arguments",
    [[FORGED], ["--x", FORGED], [f"--{FORGED}"], ["--kind", FORGED], ["--", "--json", FORGED]],
    ids=["word", "number", "option", "choice", "after --"],
)
def test_a_usage_error_is_one_printable_line(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    parser = Parser(prog=FORGED)
    parser.add_argument("--x", type=int)
    parser.add_argument("--kind", choices=("a", "b"))
    with pytest.raises(SystemExit) as ended:
        parser.parse_args(arguments)
    out, err = capsys.readouterr()
    assert (ended.value.code, out, err.count("\n")) == (2, "", 1)
    assert err[:-1].isprintable()


def test_what_an_encoding_lacks_is_escaped(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", stream)
    print_result("grün 球")
    assert stream.buffer.getvalue() == b"gr\\xfcn \\u7403\n"  # type: ignore[attr-defined]


def test_help_is_printed_in_ascii_too() -> None:
    code = "import sys; from fbql.cli.app import main; sys.exit(main(['bringup', '--help']))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, env={**os.environ, "PYTHONIOENCODING": "ascii"}, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"")


CODE = """
import os, sys
from fbql.cli.output import print_result, results_apart
from fbql.cli.parser import Parser
with results_apart():
    os.write(1, b"a library's error\\n")
    print("somebody's own controller")
    os.system("echo a child process")
    print_result("the result")
    {more}
print("afterwards")
"""


def printed(more: str = "") -> tuple[str, str]:
    done = subprocess.run([sys.executable, "-c", CODE.format(more=more)], capture_output=True, text=True, check=True)
    return done.stdout, done.stderr


def test_only_the_result_reaches_stdout_whatever_else_is_printed() -> None:
    stdout, stderr = printed()
    assert stdout == "the result\nafterwards\n"
    assert sorted(stderr.splitlines()) == ["a child process", "a library's error", "somebody's own controller"]


def test_help_is_a_result() -> None:
    stdout, _ = printed("Parser(prog='play').print_help()")
    assert "usage: play" in stdout


def test_a_reader_of_the_result_that_has_left_is_no_error() -> None:
    code = CODE.format(more="print_result('x' * 100_000)")
    done = subprocess.run(
        ["bash", "-c", '"$0" -c "$1" | true; exit ${PIPESTATUS[0]}', sys.executable, code],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
