"""`fbql_literal`: the paper's method as printed, eqs. 5 and 6."""
