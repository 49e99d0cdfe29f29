"""The commands' own nodes in a graph."""

from __future__ import annotations

from pathlib import Path

from fbql.graph.domains import free_domain
from fbql.graph.observer import Observer


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def test_a_node_that_left_the_graph_has_closed_its_sockets() -> None:
    """A domain counts as used while somebody listens there."""
    left: list[int] = []
    for _ in range(3):
        with free_domain() as domain_id:
            observer = Observer(domain_id)
            observer.look(0.1)
            looking = open_files()
            observer.close()
        left.append(open_files())
        assert left[-1] < looking
    assert left[2] == left[1]
