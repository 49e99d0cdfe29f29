"""The terminal as a screen and as a keyboard."""
