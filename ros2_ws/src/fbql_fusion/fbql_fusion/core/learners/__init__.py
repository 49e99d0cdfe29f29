"""The controllers that learn, one folder each, and the modules that they share."""
