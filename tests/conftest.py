"""What all tests share."""

from hypothesis import settings

# The machine's other work must not fail a test: no deadline for one example.
settings.register_profile("shared_machine", deadline=None)
settings.load_profile("shared_machine")
