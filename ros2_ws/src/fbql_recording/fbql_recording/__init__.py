"""Recorded runs: write (`recorder`), read (`run`) and recover (`recovery`) them. Needs no ROS."""
