"""A match on a screen, as it is played.

picture   a world state -> the field from above, as characters
page      a picture and the text beside and below it -> the lines of a screen
pace      when the next step is due: in real time, faster, slower, paused, step by step
view      the interface that a terminal and a page share
moments   a match's messages -> the moment to show, the score, the trail
words     a moment -> a sentence that explains the command
match     a moment -> the text beside and below the picture
terminal  a match on a terminal
feed      a match's messages -> the data that a page is sent
server    a page, and a connection to it, for this machine only
browser   a match on the report's page, which receives the steps live
live      a live graph on a terminal or a page
"""
