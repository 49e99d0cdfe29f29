"""What is printed where: a result on stdout, and nothing else there."""

import subprocess
import sys

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
