"""Parameters over some values, each of them over the same seeds."""
