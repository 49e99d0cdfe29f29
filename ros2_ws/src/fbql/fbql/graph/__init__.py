"""A match as a graph of ROS nodes: processes, domain, start barrier, supervision."""
