"""Bending constraints.

hinge: the dihedral angle of two triangles
isometric: quadratic, for sheets that hardly stretch
shape_operator, mid_edge: the curvature of a triangle; it converges on any mesh
hinge_moments: the same energy by hinges, with a stiffness that is quickly factored
bend_friction: internal friction
"""
