"""What a controller is, and the controllers that neither learn nor guide."""
