"""Soccer, the task of the paper: rewards, outcomes, its guide, and what its critic sees."""
