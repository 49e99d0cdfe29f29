"""Settings of the whole suite, and fixtures that start commands and nodes, none of which outlives its test.

ROS is imported only by the fixtures that need it, so that the tests of the cores run without it.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings
from leftovers import remove_leftovers

TESTS = Path(__file__).parent

if TYPE_CHECKING:
    from bringup_run import Run
    from hand_driven import Bench, Participant
    from node_process import NodeProcess

# Other load on the machine must not fail a test: no deadline for one example.
settings.register_profile("shared_machine", deadline=None)
settings.load_profile("shared_machine")

# Unless told to check, the generated message classes accept any type for any field, and send garbage.
os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")

# Hundreds of processes start here, of which each would compile every module of ours again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# A shell script that starts the suite in the background makes it, and every process that it starts, ignore SIGINT.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

MAX_WORKERS = 8
"""A worker may run a graph of five processes."""
SLOW_FIRST = ("environment", "fbql_studies", "project", "examples", "fbql", "fbql_common", "fbql_sim")
"""Folders of long tests with processes; the short ones come last and fill the gaps of the workers."""


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Runs the whole suite in parallel, a module per worker at a time; named tests run in this process."""
    is_worker = hasattr(config, "workerinput")
    names_tests = config.args_source is not pytest.Config.ArgsSource.TESTPATHS
    if not is_worker and not names_tests and getattr(config.option, "numprocesses", 0) is None:
        config.option.numprocesses, config.option.maxprocesses = "auto", MAX_WORKERS
        config.option.dist, config.option.loadscopereorder = "loadscope", False


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Orders the tests by SLOW_FIRST."""
    rank = {name: index for index, name in enumerate(SLOW_FIRST)}
    items.sort(key=lambda item: rank.get(item.path.relative_to(TESTS).parts[0], len(rank)))


def pytest_sessionstart(session: pytest.Session) -> None:
    """Removes the shared memory that killed ROS processes left, of earlier sessions and other programs."""
    if not hasattr(session.config, "workerinput"):
        remove_leftovers()


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Removes the shared memory of the processes that the tests killed."""
    if not hasattr(session.config, "workerinput"):
        remove_leftovers()


@pytest.fixture(scope="module", autouse=True)
def _own_observations_and_controllers_end_with_their_module() -> Iterator[None]:
    """A module may register observations and controllers of its own; the next one in this worker must not see them."""
    from fbql_behaviors.core.observation import OBSERVATIONS
    from own_controller import only_ours

    before = dict(OBSERVATIONS)
    with only_ours():
        yield
    for name in OBSERVATIONS.keys() - before.keys():
        del OBSERVATIONS[name]


@pytest.fixture
def place() -> Iterator[Path]:
    """A directory for many small files: in memory, if that can be written to."""
    memory = "/dev/shm"
    with TemporaryDirectory(prefix="fbql-fuzzing-", dir=memory if os.access(memory, os.W_OK) else None) as name:
        yield Path(name)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Run]]:
    """start(*arguments, ...) starts a command of ours, with its run in a directory of the test. See `Run`."""
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
        run.kill()


@pytest.fixture(scope="session")
def domain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """The environment variables of a ROS domain that nobody else on this machine uses; one for each worker."""
    from fbql.graph.domains import free_domain

    with free_domain() as domain_id:
        yield {
            "ROS_DOMAIN_ID": str(domain_id),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(tmp_path_factory.mktemp("log")),
        }


@pytest.fixture(scope="session")
def participant(domain: dict[str, str]) -> Iterator[Participant]:
    """One for all tests, because each context leaks about 1 MB."""
    from hand_driven import Participant

    result = Participant(domain)
    yield result
    result.close()


@pytest.fixture(scope="session")
def stranger(domain: dict[str, str]) -> Iterator[Participant]:
    """A second participant, like another process: within one participant a topic cannot have two types."""
    from hand_driven import Participant

    result = Participant(domain)
    yield result
    result.close()


@pytest.fixture
def bench(participant: Participant, capfd: pytest.CaptureFixture[str]) -> Iterator[Bench]:
    """Spins nodes by hand."""
    from hand_driven import Bench

    result = Bench(participant, capfd)
    yield result
    result.close()


@pytest.fixture
def other_bench(stranger: Participant, bench: Bench, capfd: pytest.CaptureFixture[str]) -> Iterator[Bench]:
    """A bench of another participant in the same namespace."""
    from hand_driven import Bench

    result = Bench(stranger, capfd)
    result.namespace = bench.namespace
    yield result
    result.close()


@pytest.fixture
def start_node(domain: dict[str, str], tmp_path: Path) -> Iterator[Callable[..., NodeProcess]]:
    """start_node(package, executable, *arguments, **environment) starts an executable; the end of the test kills it."""
    from node_process import NodeProcess

    started: list[NodeProcess] = []

    def begin(package: str, executable: str, *arguments: str, terminal: int | None = None, **env: str) -> NodeProcess:
        started.append(NodeProcess(package, executable, arguments, tmp_path, {**domain, **env}, terminal))
        return started[-1]

    yield begin
    for process in started:
        process.close()
