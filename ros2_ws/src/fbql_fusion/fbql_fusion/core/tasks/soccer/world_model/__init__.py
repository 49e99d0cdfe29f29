"""A model of robot and ball that is fitted to real steps, and the episodes imagined with it: equations 21 to 28."""
