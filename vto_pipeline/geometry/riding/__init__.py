"""One mesh rides on another: a render mesh on a simulation mesh, a fine simulation mesh on a coarse one.

binding: where each vertex sits, and where it is when the other mesh moves
layers: the triangle that each vertex belongs to, where cloth lies close to itself
surface_walk: the nearest point, followed along a surface
turns: how the surface has turned about each vertex
midpoints: every triangle in four
"""
