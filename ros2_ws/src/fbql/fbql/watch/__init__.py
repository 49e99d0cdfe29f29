"""A match on a screen, as it is played.

picture   a world state -> the field from above, as characters
page      a picture and what is beside and below it -> the lines of a screen
pace      when the next step is due: in real time, faster, slower, paused, step by step
moments   a match's messages -> the moment to show, the score, the trail
words     a moment -> why the command is what it is, in a sentence
match     a moment -> what is beside and below the picture
terminal  a live graph, or a replay, on a terminal

A view of another kind needs only `moments` and `words`, with `pace` where it has keys: they know nothing of terminals.
"""
