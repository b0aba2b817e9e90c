"""From a draped garment and a body to the numbers a fit engineer uses.

fit: the fit report
poses, motion: the fit in other poses, and over a motion
size_advice: which size of a run to take
zones, allowance: where fit is judged, and how much ease each kind of garment is cut with
ease, ease_map: garment girth minus body girth, by level and by vertex
clearance, strain: gap to the body; stretch against the rest shape
surface: sums over a surface
"""
