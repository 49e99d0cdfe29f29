"""Fills the small file system at argv[1] with a recording and a run directory; prints what became of them as JSON.

Run by test_fusion_recording.py in a mount namespace of its own.
"""

import json
import random
import sys
from contextlib import suppress
from pathlib import Path

from fbql_common.core.types import Phase
from fbql_recording.bag_metadata import Qos
from fbql_recording.core.metrics import EpisodeRecord, summarise
from fbql_recording.recorder import Channel, Recorder
from fbql_recording.run_directory import RunDirectory, create_run_directory
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader

place = Path(sys.argv[1]) / "run"
reports: list[str] = []
create_run_directory(place)
run = RunDirectory(place, {"seed": 1}, [], reports.append)
recorder = Recorder(place, [Channel("/a", "pkg/msg/A", "int64 x\n", "RIHS01_a", Qos())], {}, (), reports.append)
rng = random.Random(1)
written = episodes = 0
while not (recorder.failed and run.failed):
    for _ in range(20):
        recorder.write(0, b"\x00\x01\x00\x00" + rng.randbytes(1000), written)
        written += 1
    recorder.flush()
    run.add_episode(EpisodeRecord(episodes, Phase.LEARNING, rng.getrandbits(63), "goal", 20, 0, 0, 10.0, False))
    episodes += 1
recorder.close()

readable = 0
with recorder.active_path.open("rb") as file, suppress(EndOfFile):
    for _ in NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False):
        readable += 1
rows = (place / "episodes.csv").read_text().splitlines()[1:]
recorder.active_path.unlink()
run.write_summary(summarise("uniform", 1, [], 0, "", None, recorder.messages, recorder.failed))
summary = json.loads((place / "summary.json").read_text())
print(
    json.dumps(
        {
            "recorder_failed": recorder.failed,
            "run_failed": run.failed,
            "reports": reports,
            "written": written,
            "messages": recorder.messages,
            "readable": readable,
            "rows": len(rows),
            "whole_rows": sum(row.count(",") == 7 and row.endswith(",10.0") for row in rows),
            "summary_after_room": {"incomplete": summary["incomplete"]},
        }
    )
)
