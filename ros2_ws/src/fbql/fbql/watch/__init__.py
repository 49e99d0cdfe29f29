"""A match on a screen, as it is played.

picture   a world state -> the field from above, as characters
page      a picture and what is beside and below it -> the lines of a screen
pace      when the next step is due: in real time, faster, slower, paused, step by step
view      what a terminal and a page have in common
moments   a match's messages -> the moment to show, the score, the trail
words     a moment -> why the command is what it is, in a sentence
match     a moment -> what is beside and below the picture
terminal  a match on a terminal
feed      a match's messages -> what a page is told
server    a page, and a connection to it, for this machine only
browser   a match on a page: that of the report, whose steps come while it is open
live      a live graph on either of them
"""
