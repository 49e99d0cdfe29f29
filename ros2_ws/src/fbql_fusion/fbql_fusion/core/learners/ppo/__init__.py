"""`fbql`: proximal policy optimisation over tile-coded features, eqs. 10 to 15."""
