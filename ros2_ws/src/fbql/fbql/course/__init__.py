"""The course of `docs/course`: its texts, and the checks of its tasks, one file per lesson.

A check computes the right answer from what the student made, with the code of the project; no answer is stored anywhere.
"""
