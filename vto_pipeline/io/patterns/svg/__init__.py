"""SVG files, through svgelements.

read: drawings as patterns, ours and others'
shapes: what is drawn, as curves in metres
panels: which closed lines are panels, and what lies inside of them
write: a pattern at true size
names: how our own files mark what is what
"""
