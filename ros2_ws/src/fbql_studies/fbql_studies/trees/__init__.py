"""Study: trees from demonstrations, by objective and method."""
