"""`fbql`: proximal policy optimization over tile-coded features, eqs. 10 to 15."""
