"""A sweep: parameters over several values, each with the same seeds."""
