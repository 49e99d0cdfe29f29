"""Demonstrations: who gives them, where they come from, and the trees made from them."""
