"""What the simulator, behavior and fusion packages share."""
