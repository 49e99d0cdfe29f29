"""Shared by every package: `core` and `atomic_file` need no ROS, the other modules are for nodes."""
