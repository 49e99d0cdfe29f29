"""The launchers: thin programs that compose the packages. Each module has `main(argv) -> int`, and runs in the
environment that `scripts/NAME.py` makes sure of. Python 3.12.
"""
