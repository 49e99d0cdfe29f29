"""What a task is, and the tasks of this package."""
