"""What the benchmarks measure. The programs beside this package are their entries."""
