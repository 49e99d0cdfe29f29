"""How the pictures of the documentation are drawn, from recorded data."""
