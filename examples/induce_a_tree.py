"""Induce a decision tree from demonstrations and read it: `python examples/induce_a_tree.py`."""

# %% The scripted instructor demonstrates; the tree is found exactly, by dynamic programming.
import tempfile
from pathlib import Path

import fbql

exact = fbql.induce("wall_avoiding", method="dp", patterns=300)
print(f"{exact.leaves} leaves from {len(exact.patterns)} patterns, held-out error {exact.rmse_levels:.2f} levels")

# %% Each leaf in words.
print(exact.explain())

# %% The same patterns by trials, the paper's way. The curve is the value of the root after each trial [nat].
learned = fbql.induce("wall_avoiding", exact.patterns, method="rl", trials=50, seed=1)
print(f"after 50 trials {learned.curve[-1]:.3f} nat; the best tree has {exact.value:.3f} nat")

# %% A more expensive split makes a smaller tree.
for split_cost in (-0.01, -0.05, -0.2):
    tree = fbql.induce("wall_avoiding", exact.patterns, method="dp", split_cost=split_cost)
    print(f"split_cost {split_cost}: {tree.leaves} leaves")

# %% Play it, as an object or as a file.
played = fbql.play("subsumption", episodes=2, seed=1, trees={"wall_avoiding": exact.tree})
with tempfile.TemporaryDirectory() as directory:
    file = exact.save(Path(directory) / "wall_avoiding.json")
    again = fbql.play("subsumption", episodes=2, seed=1, trees={"wall_avoiding": file})
print("the same match:", played.summary["digest"] == again.summary["digest"])
