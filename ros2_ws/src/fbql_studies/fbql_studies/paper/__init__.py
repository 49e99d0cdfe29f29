"""Study: the paper's protocol, 50 goals while learning."""
