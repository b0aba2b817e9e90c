"""Implicit solids and their surfaces.

primitives: signed distances and the ways to join them
body, form: a human body; the dress form
surface_nets, clip: the zero level as a mesh; a mesh cut there
"""
