"""The one exception for bad input: what is wrong, where, and what to do, in one line."""


class BadInput(ValueError):
    """A request that cannot be carried out as given.

    The message is one line for a person: what is wrong, where, what to do. Programs print it and
    exit with code 2.
    """
