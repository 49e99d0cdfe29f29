"""The terminal as a keyboard and as a screen."""
