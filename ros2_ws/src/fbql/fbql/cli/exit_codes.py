"""The exit codes of every command."""

DONE = 0
FAILED = 1
BAD_INPUT = 2
"""Bad input or usage: one line states what is wrong, where, and what to do."""
INCOMPLETE = 3
"""A recording is incomplete."""
INTERRUPTED = 130
"""Ended by Ctrl-C before there was a result."""
