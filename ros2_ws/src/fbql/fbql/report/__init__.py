"""What `scripts/report.py` and `scripts/compare.py` make of recorded runs: a page, figures, tables."""
