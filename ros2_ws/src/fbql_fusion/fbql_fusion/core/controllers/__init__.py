"""The interface of controllers, and the controllers that do not learn."""
