"""Study: other methods in the same simulator with the same budget of steps."""
