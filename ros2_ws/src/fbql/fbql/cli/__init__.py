"""The command line: finding and running commands, options, progress, errors and exit codes."""
