"""Study: the weighted objective against the printed one."""
