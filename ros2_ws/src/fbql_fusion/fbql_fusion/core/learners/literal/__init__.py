"""`fbql_literal`: the paper's method as it is printed, eqs. 5 and 6."""
