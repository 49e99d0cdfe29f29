"""The studies that `scripts/experiment.py` runs: each a module with tasks, run, table and, if it draws, figures."""
