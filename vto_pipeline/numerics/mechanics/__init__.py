"""Mechanics of single stencils.

membrane, plane_stress, tension, monotone_curve: strain, stress and their stiffness
bending: the hinge angle
slider, friction: dry friction inside the cloth and at contacts
xpbd_row: one scalar constraint of XPBD
"""
