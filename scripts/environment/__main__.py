"""`python3 scripts/environment`: set up if necessary, and print the commands for a shell. See scripts/env.sh."""

import os
import shlex
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from environment.ready import environment_or_exit
from environment.ros2 import SCRIPTS, real_ros2
from environment.variables import BOOTSTRAPPED, append


def exports(before, environ):
    """`export` and `unset` lines, for bash and zsh, that turn the variables `before` into `environ`.

    scripts/ is added to PATH where there is no real `ros2`. The mark of the wheels' start-up hook is left out: it would
    be inherited by Pythons of other environments, whose libraries it would keep from being found.
    """
    after = {name: value for name, value in environ.items() if name != BOOTSTRAPPED}
    if real_ros2(after["PATH"]) is None:
        append(after, "PATH", [SCRIPTS])
    changed = [f"export {name}={shlex.quote(after[name])}" for name in sorted(after) if before.get(name) != after[name]]
    gone = [f"unset {name}" for name in sorted(before) if name not in after]
    return "\n".join([*changed, *gone, ""])


if __name__ == "__main__":
    print(exports(os.environ, environment_or_exit()[1]), end="")
