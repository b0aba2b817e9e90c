"""Colliders for users.

colliders: sphere, capsule, ellipsoid, box, plane, mesh
solid: contacts with a solid that has a formula
pose, moving: a place and a path through time
"""
