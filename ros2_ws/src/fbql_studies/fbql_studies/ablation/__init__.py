"""Study: fbql without one of its parts."""
