"""Joints that a camera follows: places, without rotations.

parse: JSON lines in, a clip out
lines: frames of places by joint, from any layout
live, feed: one by one, as they come; the newest of them
turns: the rotations of a skeleton whose joints are there
"""
