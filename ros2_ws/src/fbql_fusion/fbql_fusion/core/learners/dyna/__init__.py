"""`fbql_model`: the method of `fbql` in imagined episodes (Dyna)."""
