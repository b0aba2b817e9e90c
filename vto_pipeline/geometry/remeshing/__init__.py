"""Remeshing, repair and hole filling.

remesh, isotropic: triangles of one size; layers: each vertex back in its own layer
rims: openings before that and how long they stay; slivers: flat triangles after it
decimate: fewer
clip: along the line where a value changes sign
holes: filled so that the filling continues the surface; ears and triangulate span them, refine makes triangles even
fold: how much two triangles fold
flat_faces: the panels of a mesh carried over onto another
repair: from a triangle soup to an oriented manifold
seams: a textured mesh with a vertex for each side of a seam
"""
