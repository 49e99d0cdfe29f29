"""What all tests share."""

import os
import signal
from pathlib import Path

from hypothesis import settings

# The machine's other work must not fail a test: no deadline for one example.
settings.register_profile("shared_machine", deadline=None)
settings.load_profile("shared_machine")

# Programs that a test starts find what the test itself finds.
_PLACES = [str(Path(__file__).resolve().parents[1] / "scripts"), os.environ.get("PYTHONPATH", "")]
os.environ["PYTHONPATH"] = os.pathsep.join(place for place in _PLACES if place)

# The generated message classes take any type for any field, and send garbage, unless they are told to look.
os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")

# A script that starts the suite in the background has SIGINT ignored in it, and so in all that it starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
