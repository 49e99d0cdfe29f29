"""What every study shares: tasks, the store of their results, workers."""
