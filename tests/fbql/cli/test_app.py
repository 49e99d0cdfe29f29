"""The program `fbql`: every way in which a command can end is one line and an exit code."""

from __future__ import annotations

import errno
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from fbql.cli import app, places
from fbql.cli.interrupts import Interrupted
from fbql.cli.output import Unwritable
from fbql.cli.parser import Parser
from fbql_common.core.errors import BadInput


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch) -> Callable[[BaseException | int], int]:
    """Runs a command of another package, found by its entry point, that ends in the way that is given."""

    def call(ending: BaseException | int) -> int:
        def run(_arguments: object, _interrupts: object) -> int:
            if isinstance(ending, BaseException):
                raise ending
            return ending

        words = "Does a thing. It resumes.\n\nMore."
        module = SimpleNamespace(parser=lambda program: Parser(prog=program), run=run, __doc__=words)
        entry = SimpleNamespace(name="thing", load=lambda: module)
        monkeypatch.setattr(app, "entry_points", lambda **wanted: [entry] * (wanted.get("name", "thing") == "thing"))
        monkeypatch.setattr(app.Interrupts, "install", lambda _: None)
        return app.main(["thing"])

    return call


@pytest.mark.parametrize(
    ("ending", "code", "line"),
    [
        (0, 0, ""),
        (3, 3, ""),
        (BadInput("x is bad"), 2, "fbql thing: x is bad\n"),
        (Interrupted("ended by SIGTERM"), 1, "fbql thing: ended by SIGTERM\n"),
        (KeyboardInterrupt(), 130, "fbql thing: interrupted\n"),
        (
            Unwritable(Path("out"), OSError(errno.ENOSPC, "full")),
            1,
            "fbql thing: out: cannot be written (full); make room there, or choose another place\n",
        ),
        (
            Unwritable(Path("out"), OSError(errno.EACCES, "no")),
            2,
            "fbql thing: out: cannot be written (no); choose another place\n",
        ),
        (
            OSError(errno.ENOSPC, "full", "file"),
            1,
            "fbql thing: file: cannot be written (full); make room there, or choose another place\n",
        ),
        (OSError(errno.EIO, "broken", "file"), 1, "fbql thing: file: broken\n"),
    ],
)
def test_every_ending_is_an_exit_code_and_at_most_one_line(
    command: Callable[..., int], capsys: pytest.CaptureFixture[str], ending: BaseException | int, code: int, line: str
) -> None:
    assert command(ending) == code
    assert capsys.readouterr() == ("", line)


@pytest.mark.parametrize(
    ("module", "says"),
    [("rclpy.node", "needs ROS 2 Jazzy"), ("matplotlib", "needs matplotlib, which is not installed: ")],
)
def test_a_package_that_is_not_installed_is_one_line(
    command: Callable[..., int], capsys: pytest.CaptureFixture[str], module: str, says: str
) -> None:
    assert command(ModuleNotFoundError(name=module)) == 2
    assert says in capsys.readouterr().err


def test_a_module_that_every_installation_has_is_a_bug_and_stays_a_traceback(command: Callable[..., int]) -> None:
    with pytest.raises(ModuleNotFoundError):
        command(ModuleNotFoundError(name="fbql.nothing"))


def test_help_lists_commands_of_other_packages_with_their_first_sentence(
    command: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    command(0)
    assert app.main(["--help"]) == 0
    out = capsys.readouterr().out
    assert "  thing        does a thing\n" in out
    assert all(f"  {name}" in out for name in app.COMMANDS)


@pytest.mark.parametrize(("words", "says"), [([], "name a COMMAND"), (["nothing"], "no command 'nothing'")])
def test_a_command_that_is_not_there_is_refused(
    capsys: pytest.CaptureFixture[str], words: list[str], says: str
) -> None:
    assert app.main(words) == 2
    assert says in capsys.readouterr().err


def test_a_program_of_ros_says_what_to_type_next_as_ros2_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(places, "_form", "fbql {}")
    monkeypatch.setattr("sys.argv", ["/opt/lib/fbql/tree", "--help"])
    with pytest.raises(SystemExit):
        app.executable()
    assert places.command_text("report") == "ros2 run fbql report"


def test_every_command_is_in_the_package_and_has_a_door() -> None:
    from places import ROOT  # the tests' own, not fbql.cli.places

    setup = (ROOT / "ros2_ws/src/fbql/setup.py").read_text()
    for name in (*app.COMMANDS, "experiment", "sweep"):
        assert f'"{name}"' in setup
        assert (ROOT / "scripts" / f"{name}.py").is_file()
