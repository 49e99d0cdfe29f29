"""What several studies share: method names, training and frozen play, tuned controls, tables, drawing."""
