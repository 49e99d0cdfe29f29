"""Who would drive without learning: the rules that a guide is made of."""
