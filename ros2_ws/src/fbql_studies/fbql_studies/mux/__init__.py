"""Study: a mux that learns, against priorities, in rooms."""
