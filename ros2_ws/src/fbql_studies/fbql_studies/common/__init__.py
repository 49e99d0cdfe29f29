"""Shared by several studies: method names, training and frozen play, tuned controls, tables, drawing."""
