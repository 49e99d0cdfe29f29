"""Intervals, tests and tables over runs."""
