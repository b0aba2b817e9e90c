"""Independent audit: formulas of its own, shared with no solver and no collision code.

audit: finite, crossings, penetration, strain, energy, residual
residual: energy and residual force, computed a second time
curvature: stiffness of bending, likewise
flanks, bearing: where a body may carry a point, and what force it can carry there
gap: how near a cloth comes to itself
order: whether what is worn beneath lies beneath
strain, too_small: stretch against the rest shape; whether the garment is too small
limits: whether threads are drawn or sheared farther than the fabric is known to bear
elsewhere, turned_up: whether it ended far from where it was put on; whether part of a hem ended turned up
worn: strain of the yarns and pressure on the body, vertex by vertex
"""
