"""Any robot that takes velocity commands: several sources of commands, of which one drives at a time."""
