"""Study: fbql with more behaviors."""
