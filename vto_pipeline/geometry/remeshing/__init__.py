"""Remeshing, repair and hole filling.

remesh, isotropic: triangles of one size
decimate, subdivide: fewer, more
clip: along the line where a value changes sign
holes, triangulate: holes filled so that the filling continues the surface
flat_faces: the panels of a mesh carried over onto another
repair: from a triangle soup to an oriented manifold
"""
