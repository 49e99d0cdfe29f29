"""The installed programs, `fbql` and `ros2 run fbql NAME`: signals wait until the command is there to act on them."""

from __future__ import annotations

from fbql.cli.interrupts import hold_signals


def main() -> int:
    """`fbql COMMAND ...`. Returns the exit code."""
    hold_signals()
    from fbql.cli import app

    return app.main()


def executable() -> int:
    """`ros2 run fbql NAME ...`: the program is called what its command is. Returns the exit code."""
    hold_signals()
    from fbql.cli import app

    return app.executable()
