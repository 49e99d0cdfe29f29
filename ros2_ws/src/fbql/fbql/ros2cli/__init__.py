"""`ros2 topic`, `node` and `param` where no real ros2 is installed, for looking at a graph from a second shell.

Options, output and exit codes are those of ros2cli, as far as they go. There is no daemon: each command joins the graph and
looks for what it needs.

graph   the node that looks, and how long
topic   list, info, echo, hz
node    list, info
param   list, get
"""
