"""Demonstrations: who gives them, how they are recorded, replayed and merged, and the trees made from them."""
