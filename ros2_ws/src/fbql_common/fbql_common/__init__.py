"""Shared by every package: `core`, `files` and `own_code` need no ROS; the other modules are for nodes."""
