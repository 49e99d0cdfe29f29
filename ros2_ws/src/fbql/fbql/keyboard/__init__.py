"""A person demonstrates: drives the robot live with the keys of a terminal.

keys      bytes of a terminal -> keys
driving   keys -> wheel velocities
picture   a world state -> the field from above, as characters
page      picture and status -> the lines of a screen
sitting   the demonstrations so far: begun, kept, undone
terminal  the terminal itself: taken over, drawn on, given back
live      the simulator as a process of the graph, and our node in it
drive     the loop that joins them

All but `terminal`, `live` and `drive` are pure: no clock, no ROS, no terminal.
"""
