"""Read a recorded run: `python examples/read_a_recording.py [RUN]`, a run directory or an .mcap file. No ROS needed."""

# %% Open it: by default the recording of the tests.
import sys
from pathlib import Path

import fbql

RECORDED = Path(__file__).resolve().parents[1] / "tests" / "data" / "recorded_match"
run = fbql.open_run(sys.argv[1] if len(sys.argv) > 1 else RECORDED)
print(f"{run.path.name}: {', '.join(run.behaviors)}; {'complete' if run.is_complete else 'incomplete'}")

# %% The parameters that were in force.
fusion = run.parameters["fusion"]
print(f"controller {fusion['controller']}, seed {fusion['seed']}")

# %% Episode by episode.
for episode in run.episodes():
    print(f"episode {episode.index} ({episode.phase}): {episode.outcome} after {episode.steps} steps")

# %% Step by step, without keeping them: what was sensed, who answered what, what was decided.
switches, driver = 0, None
for step in run.steps():
    if step.decision is not None and step.decision.driver != driver:
        switches, driver = switches + 1, step.decision.driver
print(f"the driver changed {switches} times")

# %% Or all steps as arrays, one row per step.
columns = run.arrays()
print(f"{len(columns['step'])} steps; mean weights {columns['weights'].mean(axis=0).round(2)}")
