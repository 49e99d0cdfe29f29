"""Shared by every package: `core`, `atomic_file` and `own_code` need no ROS; the other modules are for nodes."""
