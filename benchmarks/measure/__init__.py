"""The benchmarks. The programs beside this package start them."""
