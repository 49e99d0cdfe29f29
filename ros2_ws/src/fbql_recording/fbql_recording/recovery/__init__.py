"""Damaged recordings: finds their undamaged parts, and writes them to a new run directory."""
