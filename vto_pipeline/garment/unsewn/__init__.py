"""From a garment in space back to its sewing pattern.

rims: its openings, and the type of garment they tell
noise: how noisy a scan is, and the surface without that
cut: pieces between seams, and which outline is sewn to which
flatten: a piece laid flat with the least work of its fabric
outline: corners, and smooth lines between them
names: of panels
find: seams by the type of garment
trace: lines made edges of the mesh
unsew: pieces to a pattern
recover: where to cut, and all of it
"""
