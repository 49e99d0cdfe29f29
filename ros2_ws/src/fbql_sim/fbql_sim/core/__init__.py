"""The pure part: no ROS, no clock, no file paths."""
