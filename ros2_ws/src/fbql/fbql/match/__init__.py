"""A match: its options, playing it in one process without ROS, its result in words."""
