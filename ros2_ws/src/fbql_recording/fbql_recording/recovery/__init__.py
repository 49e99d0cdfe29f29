"""Damaged recordings: what of them is sound, and a new run directory that holds it."""
