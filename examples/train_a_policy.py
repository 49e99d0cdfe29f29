"""Train a controller, play what it learned, and compare it with a baseline: `python examples/train_a_policy.py [EPISODES]`."""

# %% Train from scratch: guided episodes first, then its own.
import sys
import tempfile
from pathlib import Path

import fbql
from fbql.statistics.inference import paired_p_value, ratio_of_sums

EPISODES = int(sys.argv[1]) if len(sys.argv) > 1 else 40
SEEDS = range(1, 6)

learned = fbql.train(episodes=EPISODES, guided=EPISODES // 4, policy="none", seed=1)
print(f"trained: {learned.summary['goals']} goals in {learned.summary['episodes']} episodes")

# %% A policy is a file for later, or for the commands: --policy FILE.
with tempfile.TemporaryDirectory() as directory:
    file = learned.policy.save(Path(directory) / "policy.npz")
    print(f"the policy has {file.stat().st_size} bytes")

# %% Play it frozen, and the baseline, from the same starts: the same seed gives the same starts.
PER_RUN = max(2, EPISODES // 8)
ours = [fbql.play(policy=learned.policy, learn=False, episodes=PER_RUN, seed=seed).summary for seed in SEEDS]
baseline = [fbql.play("subsumption", preset="paper", episodes=PER_RUN, seed=seed).summary for seed in SEEDS]

# %% Steps per goal over all runs, with a 95 % bootstrap interval over the runs.
for name, runs in (("learned", ours), ("Subsumption, thresholds of the paper", baseline)):
    cost = ratio_of_sums([run["steps"] for run in runs], [run["goals"] for run in runs])
    print(f"{name}: {cost.estimate:.0f} steps per goal ({cost.low:.0f} to {cost.high:.0f})")

# %% Paired, run by run. With five runs, p can't be below .06, however large the difference.
costs = [[run["steps"] / max(run["goals"], 1) for run in runs] for runs in (ours, baseline)]
print(f"paired permutation test of equal costs: p = {paired_p_value(*costs):.3f}")
