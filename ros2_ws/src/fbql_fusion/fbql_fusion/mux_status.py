"""The state of a mux as diagnostics, with the names that twist_mux gives them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from fbql_fusion.core.mux.config import Lock, Source, rank
from fbql_fusion.core.mux.mux import LockState, Snapshot, SourceState

_NS = 1e9


def diagnostics_of(
    node: str, snapshot: Snapshot, dropped: Sequence[int], stamp: Time, problem: str = ""
) -> DiagnosticArray:
    """The status of a mux.

    Args:
        node: the node's name.
        dropped: how many messages of each source were dropped.
        problem: what keeps the mux from learning; empty if nothing does.
    """
    driver = None if snapshot.driver is None else snapshot.sources[snapshot.driver]
    values = {
        **{f"velocity topics.{state.source.name}": _source_text(state, state is driver) for state in snapshot.sources},
        **{f"lock locks.{state.lock.name}": _lock_text(state) for state in snapshot.locks},
        "current priority": str(snapshot.lock_priority),
        "data age in [sec]": "" if driver is None or driver.age_ns is None else f"{driver.age_ns / _NS:.3f}",
        "driver": "" if driver is None else driver.source.name,
        **_dropped_texts(snapshot, dropped),
        **({"outcome": problem} if problem else {}),
    }
    drives = f"{'nobody' if driver is None else driver.source.name} drives"
    status = DiagnosticStatus(
        level=DiagnosticStatus.WARN if problem else DiagnosticStatus.OK,
        name=f"{node}: Twist mux status",
        message=f"{problem}: {drives}" if problem else f"ok: {drives}",
        hardware_id="none",
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp
    return message


def _source_text(state: SourceState, drives: bool) -> str:
    """The first word is twist_mux's: masked or unmasked."""
    why = [
        word for word, applies in (("expired", state.expired), ("locked", state.locked), ("drives", drives)) if applies
    ]
    return ", ".join(["masked" if state.masked else "unmasked", *why, _entry_text(state.source)])


def _lock_text(state: LockState) -> str:
    """The first word is twist_mux's: locked or free."""
    return ", ".join(
        ["locked" if state.on else "free", *(["expired"] if state.expired else []), _entry_text(state.lock)]
    )


def _entry_text(entry: Source | Lock) -> str:
    timeout = f"{entry.timeout_s:g} s" if entry.timeout_s > 0 else "none"
    return f"topic {entry.topic}, timeout {timeout}, priority {rank(entry)}"


def _dropped_texts(snapshot: Snapshot, dropped: Sequence[int]) -> Mapping[str, str]:
    return {
        f"dropped topics.{state.source.name}": str(count)
        for state, count in zip(snapshot.sources, dropped, strict=True)
        if count
    }
