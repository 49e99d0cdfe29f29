"""Study: fbql with other parameter values and other guides."""
