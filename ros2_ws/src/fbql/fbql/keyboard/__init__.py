"""A person demonstrates: drives the robot live with the keys of a terminal.

steering  keys -> wheel velocities
picture   a world state -> the field from above, as characters
page      picture and status -> the lines of a screen
sitting   the demonstrations so far, and their copies on disk
live      the simulator as a process of the graph, and the node that drives it
drive     the loop that joins them
show      plays demonstrations back on the screen
show_in_browser  and on a page
"""
