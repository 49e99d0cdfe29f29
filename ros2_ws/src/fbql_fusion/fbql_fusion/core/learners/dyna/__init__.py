"""`fbql_model`: the update of `fbql` in imagined episodes (Dyna)."""
