"""`python3 scripts/environment`: set up if need be, and print the commands for a shell. See scripts/env.sh."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from environment.shell import main

if __name__ == "__main__":
    sys.exit(main())
