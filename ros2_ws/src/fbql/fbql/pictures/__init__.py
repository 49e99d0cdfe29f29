"""Pictures: the style of our figures, and the documentation's picture of an episode."""
