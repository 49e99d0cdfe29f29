"""A run of a mux that learns the rail, recorded as its node records it, without ROS between them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fbql_common.core.mux_types import RobotOutcome
from fbql_common.core.twist import Twist
from fbql_common.wire import encode_mux_decision, encode_twist
from fbql_fusion.core.mux.learned import LearnedMux
from fbql_fusion.core.mux.learning import description_of, session_of
from fbql_fusion.core.mux.mux import Mux
from fbql_fusion.mux_recorder import MuxRecorder
from fbql_fusion.policy_storage import load_policy
from rail import PERIOD_NS, SOURCES, Rail, Result, at

VALUES: dict[str, Any] = {
    "learn": True,
    "record": True,
    "hold_s": 0.3,
    "play_s": 0.2,
    "fbql_batch_episodes": 3,
    "topics": {name: {"topic": f"/{name}", "timeout": 0.25, "priority": 10} for name in SOURCES},
    "axes": {
        "linear_x": {"low": -1.0, "high": 1.0, "levels": 5},
        "angular_z": {"low": -2.0, "high": 2.0, "levels": 5},
    },
    "observations": {
        name: {"topic": f"/{name}", "type": "std_msgs/msg/Float64", "field": "data", "low": -1.0, "high": 1.0}
        for name in ("position", "side")
    },
}


def record_rail(path: Path, episodes: int = 25, silent: range = range(0), **changes: Any) -> Path:
    """Plays and records episodes; the second source is silent now and then, and during the periods `silent` nobody tells outcomes.
    Returns the run directory."""
    description = description_of({**VALUES, "run_directory": str(path), **changes}, "test")
    policy = load_policy(Path(description.learned.policy)) if description.learned.policy else None
    session = session_of(description, policy)
    learned = LearnedMux(Mux(description.config), session, description.robot, 100, description.learned.segment_s)
    learned.has_episodes = True
    said: list[str] = []
    recorder = MuxRecorder(description, session, lambda topic: f"/{topic}", said.append)
    rail, now_ns = Rail(), 0
    for episode in range(episodes):
        rail.reset(episode)
        result, is_over = Result(), False
        while not is_over:
            now_ns += PERIOD_NS
            for place, (value,) in enumerate(rail.observed):
                learned.hear_observation(place, value, now_ns)
            for index, speed in enumerate(SOURCES.values()):
                if index == 0 or now_ns // PERIOD_NS % 7 > 3:
                    learned.hear(index, Twist(speed), now_ns)
            is_silent = now_ns // PERIOD_NS in silent
            learned.look(0 if is_silent else 1, 0)
            if not is_silent:
                learned.hear_outcome(RobotOutcome(now_ns, *result))
            elif result.terminated or result.truncated:
                rail.reset(episode)
            for ticked in learned.tick(at(now_ns, now_ns)):
                decision = ticked.decision
                recorder.record_command(encode_twist(Twist(decision.command[0])), now_ns)
                recorder.record_decision(encode_mux_decision(decision), now_ns)
                is_over = decision.terminated or decision.truncated
                result = rail.step(decision.command[0])
    recorder.close()
    assert said == []
    return path
