"""Shared by every study: tasks, the store of their results, workers."""
