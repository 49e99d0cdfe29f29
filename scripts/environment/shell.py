"""What `scripts/env.sh` asks for: the shell commands that give an interactive shell the environment."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping

from .process import BOOTSTRAPPED, append
from .ros2 import SCRIPTS, real_ros2


def exports(before: Mapping[str, str], environ: Mapping[str, str]) -> str:
    """`export` and `unset` lines, for bash and zsh, that turn the variables `before` into `environ`.

    scripts/ is added to PATH where there is no real `ros2`. The mark of the wheels' start-up hook is left out: it would
    be inherited by Pythons of other environments, whose libraries it would keep from being found.
    """
    after = dict(environ)
    after.pop(BOOTSTRAPPED, None)
    if real_ros2(after["PATH"]) is None:
        append(after, "PATH", [SCRIPTS])
    changed = [f"export {name}={shlex.quote(after[name])}" for name in sorted(after) if before.get(name) != after[name]]
    gone = [f"unset {name}" for name in sorted(before) if name not in after]
    return "\n".join([*changed, *gone, ""])


def main() -> int:
    """Write the lines to stdout, which env.sh evaluates; the set-up's progress goes to stderr as ever."""
    from .enter import environment_or_exit

    _, environ = environment_or_exit()
    print(exports(os.environ, environ), end="")
    return 0
