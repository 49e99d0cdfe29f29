"""What all tests share: settings, and fixtures that start commands and nodes, none of which outlives its test.

ROS is imported only by the fixtures that need it, so that the tests of the cores run without it.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from bringup_run import Run
    from hand_driven import Bench, Participant
    from node_process import NodeProcess

# The machine's other work must not fail a test: no deadline for one example.
settings.register_profile("shared_machine", deadline=None)
settings.load_profile("shared_machine")

# The generated message classes take any type for any field, and send garbage, unless they are told to look.
os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")

# A script that starts the suite in the background has SIGINT ignored in it, and so in all that it starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Run]]:
    """Starts a command of ours with its run in a directory of the test: start(*arguments, ...). See `Run`."""
    from bringup_run import Run

    started: list[Run] = []

    def begin(*arguments: str, out: bool = True, **options: object) -> Run:
        place = tmp_path / str(len(started))
        place.mkdir()
        words = [*arguments, "--out", str(place / "run")] if out else list(arguments)
        started.append(Run(place, words, **options))
        return started[-1]

    yield begin
    for run in started:
        run.close()


@pytest.fixture(scope="session")
def domain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """The environment variables of a domain of our own on this machine. They are in force nowhere else."""
    import domain_coordinator

    with domain_coordinator.domain_id() as domain_id:
        yield {
            "ROS_DOMAIN_ID": str(domain_id),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(tmp_path_factory.mktemp("log")),
        }


@pytest.fixture(scope="session")
def participant(domain: dict[str, str]) -> Iterator[Participant]:
    """One for all tests: each cycle of a context leaks about 1 MB."""
    from hand_driven import Participant

    result = Participant(domain)
    yield result
    result.close()


@pytest.fixture(scope="session")
def stranger(domain: dict[str, str]) -> Iterator[Participant]:
    """A second participant, as another process would be: within one no topic can have two types."""
    from hand_driven import Participant

    result = Participant(domain)
    yield result
    result.close()


@pytest.fixture
def bench(participant: Participant, capfd: pytest.CaptureFixture[str]) -> Iterator[Bench]:
    """Nodes driven by hand."""
    from hand_driven import Bench

    result = Bench(participant, capfd)
    yield result
    result.close()


@pytest.fixture
def other_bench(stranger: Participant, bench: Bench, capfd: pytest.CaptureFixture[str]) -> Iterator[Bench]:
    """Nodes of another participant in the same namespace."""
    from hand_driven import Bench

    result = Bench(stranger, capfd)
    result.namespace = bench.namespace
    yield result
    result.close()


@pytest.fixture
def start_node(domain: dict[str, str], tmp_path: Path) -> Iterator[Callable[..., NodeProcess]]:
    """Starts executables: start_node(package, executable, *arguments, **environment). Whatever still runs is killed."""
    from node_process import NodeProcess

    started: list[NodeProcess] = []

    def begin(package: str, executable: str, *arguments: str, **env: str) -> NodeProcess:
        started.append(NodeProcess(package, executable, arguments, tmp_path, {**domain, **env}))
        return started[-1]

    yield begin
    for process in started:
        process.close()
