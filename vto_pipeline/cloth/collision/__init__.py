"""Contact with bodies, shapes and itself, independent of any solver.

contacts: the planes that solvers see
shapes/: colliders as users give them
body/: a body of triangles that may move
self_collision/: cloth against itself and against features of bodies
response/: what a method does about contacts
"""
