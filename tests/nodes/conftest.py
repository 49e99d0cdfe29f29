"""A private domain, the benches on which nodes are driven by hand, and nodes as real processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import domain_coordinator
import pytest
from hand_driven import Bench, Participant
from node_process import NodeProcess


@pytest.fixture(scope="session")
def domain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """The environment variables of a domain of our own on this machine. They are in force nowhere else."""
    with domain_coordinator.domain_id() as domain_id:
        yield {
            "ROS_DOMAIN_ID": str(domain_id),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(tmp_path_factory.mktemp("log")),
        }


@pytest.fixture(scope="session")
def participant(domain: dict[str, str]) -> Iterator[Participant]:
    """One for all tests: each cycle of a context leaks about 1 MB."""
    result = Participant(domain)
    yield result
    result.close()


@pytest.fixture(scope="session")
def stranger(domain: dict[str, str]) -> Iterator[Participant]:
    """A second participant, as another process would be: within one no topic can have two types."""
    result = Participant(domain)
    yield result
    result.close()


@pytest.fixture
def bench(participant: Participant, capfd: pytest.CaptureFixture[str]) -> Iterator[Bench]:
    result = Bench(participant, capfd)
    yield result
    result.close()


@pytest.fixture
def other_bench(stranger: Participant, bench: Bench, capfd: pytest.CaptureFixture[str]) -> Iterator[Bench]:
    """Nodes of another participant in the same namespace."""
    result = Bench(stranger, capfd)
    result.namespace = bench.namespace
    yield result
    result.close()


@pytest.fixture
def start(domain: dict[str, str], tmp_path: Path) -> Iterator[Callable[..., NodeProcess]]:
    """Starts executables: start(package, executable, *arguments, **environment). Whatever still runs is killed."""
    started: list[NodeProcess] = []

    def begin(package: str, executable: str, *arguments: str, **env: str) -> NodeProcess:
        started.append(NodeProcess(package, executable, arguments, tmp_path, {**domain, **env}))
        return started[-1]

    yield begin
    for process in started:
        process.close()
