"""The fusion node's parameters other than those of fusion itself."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.parameters import parameter

DEFAULT_GOALS = 10
"""How many goals end a match for which no other length is given."""


@dataclass(frozen=True)
class FusionNodeParameters:
    """Files, and what to do when an input is missing."""

    run_directory: str = parameter(
        "",
        "directory of the run: a new one, or an existing one without a recording; "
        "empty: runs/TIME-CONTROLLER-sSEED in the working directory",
    )
    record: bool = parameter(True, "whether the run is recorded to MCAP")
    policy: str = parameter(
        "",
        "policy.npz of an earlier run to start from, or shipped; empty or none: untrained. If it is not given, a node that "
        "plays fbql with the usual behaviors starts from the shipped one, as bringup does",
    )
    controller_file: str = parameter(
        "", "FILE.py:NAME of your own controller; empty: one of this package or of an installed one"
    )
    tree_files: list[str] = parameter(
        [],
        "tree files in use, in the order of the behaviors: copied into the run directory and the recording, and used by "
        "fbql_model to imagine",
    )
    config_file: str = parameter(
        "", "parameter file of the whole graph, for the run's config.yaml; empty: only this node's"
    )
    flush_period_s: float = parameter(
        0.5, "longest stretch of a recording that a crash can lose", unit="s", low=0.05, high=60.0
    )
    behavior_timeout_s: float = parameter(
        0.1,
        "a behavior that answers later than this is left out: its weight goes to the others, and nothing more is learned "
        "in this episode; 0: never",
        unit="s",
        low=0.0,
        high=60.0,
    )
    start_timeout_s: float = parameter(
        0.0, "inputs still missing after this time end the run; 0: waits forever", unit="s", low=0.0, high=3700.0
    )
    lockstep_timeout_s: float = parameter(
        0.0,
        "a step whose answers, or whose world state, take longer than this ends the run; 0: waits forever",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    world_timeout_s: float = parameter(
        0.5, "without a world state for this long the wheels are stopped", unit="s", low=0.05, high=60.0
    )
