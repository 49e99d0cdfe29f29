"""Controllers that can drive the guided episodes."""
