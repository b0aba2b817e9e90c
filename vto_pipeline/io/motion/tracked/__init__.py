"""Joints that a camera follows: places, without rotations.

parse: JSON lines in, a clip out
lines: frames of places by joint, from any layout
turns: the rotations of a skeleton whose joints are there
"""
