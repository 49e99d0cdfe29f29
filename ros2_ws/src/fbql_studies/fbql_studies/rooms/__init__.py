"""The rooms: a mobile robot that has to get to a goal, for the study of the mux and for examples/rooms. Needs no ROS."""
