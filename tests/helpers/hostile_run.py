"""A recording by somebody who means harm: every name in it is markup."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.tree import Leaf, Split, Tree
from fbql_behaviors.storage import tree_to_bytes
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_common.wire import encode_command, encode_decision, encode_output, encode_world
from fbql_recording.bag_metadata import Qos
from fbql_recording.recorder import Attachment, Channel, Recorder
from fbql_recording.run import open_run
from recorded_match import record_match

HOSTILE = """</script><script>alert(1)</script><img src=x onerror=alert(2)>"'<!--&lt;\\u003c${alert(3)}"""
BEHAVIOR = """<script><!--<img\u202esrc=x\tonerror=alert(4)>"'&lt;"""
"""Without a space or a slash, which end a behavior's name."""
STEPS = 5


def hostile_run(path: Path) -> Path:
    """Makes it; gives its directory."""
    honest = open_run(record_match(path.with_name("honest"), max_steps=5, episodes=1))
    types = {topic.type_name.rpartition("/")[2]: topic for topic in honest.topics.values()}
    names = {"WorldState": "/world", "BehaviorOutput": f"/behaviors/{BEHAVIOR}", "WheelCommand": "/wheel_command"}
    names["FusionDecision"] = f"/fusion/{HOSTILE.replace('/', '')}"
    channels = [
        Channel(topic, types[kind].type_name, types[kind].schema, types[kind].metadata["topic_type_hash"], Qos())
        for kind, topic in names.items()
    ]
    tree = Tree(
        HOSTILE,
        (Feature(HOSTILE, HOSTILE, 0.0, 1.0),),
        (Split(0, 0.5, 1, 2), 0, 1),
        (Leaf(1.0, 1.0, 1), Leaf(2.0, 2.0, 1)),
    )
    config = {
        "versions": {HOSTILE: HOSTILE},
        "git_revision": HOSTILE,
        "parameters": {
            HOSTILE: {HOSTILE: [HOSTILE]},
            "fusion": {"controller": HOSTILE, "seed": HOSTILE, "layers": [HOSTILE], "behaviors": [BEHAVIOR]},
        },
    }
    attachments = [
        Attachment("config.yaml", "", yaml.safe_dump(config).encode()),
        Attachment(f"trees/{HOSTILE}.json", "", tree_to_bytes(tree)),
        Attachment("trees/damaged.json", "", HOSTILE.encode()),
    ]
    path.mkdir()
    recorder = Recorder(path, channels, {"behaviors": BEHAVIOR}, attachments, pytest.fail)
    for step in range(STEPS):
        stamp_ns = step * 20_000_000
        numbers = (stamp_ns, 0, step)
        messages = [
            encode_world(World(*numbers, *[0.1] * 12, False, False, False, False, False, False)),
            encode_output(BehaviorOutput(*numbers, BEHAVIOR, 1.0, 1.0, 0, 2, tree.hash, False, (0.2,))),
            encode_command(WheelCommand(*numbers, 1.0, 1.0)),
            encode_decision(Decision(*numbers, HOSTILE, 1, (BEHAVIOR,), (0,), (), (1.0,), 0, 0.0, False)),
        ]
        for place, data in enumerate(messages):
            recorder.write(place, data, stamp_ns)
    recorder.close()
    return path
