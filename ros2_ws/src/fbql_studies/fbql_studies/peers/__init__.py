"""Ordinary methods on the same work: environments that take the behaviors in, and what learns in them."""
