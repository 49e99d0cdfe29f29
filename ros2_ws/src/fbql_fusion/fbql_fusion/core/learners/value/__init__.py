"""`fbql_value`: the paper's method repaired by learning action values, eqs. 16 to 20."""
