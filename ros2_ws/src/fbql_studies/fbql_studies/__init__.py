"""Studies over many seeds. `fbql experiment NAME` runs them."""
