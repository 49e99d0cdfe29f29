"""The controllers that learn, a folder each, and beside them what they share."""
