"""Recordings played again: onto ROS, verified bit by bit, or with other parameters."""
