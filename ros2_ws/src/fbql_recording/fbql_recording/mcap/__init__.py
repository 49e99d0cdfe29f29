"""MCAP files: the format, reading with every check, and writing while a run is in progress."""
