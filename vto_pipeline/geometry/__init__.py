"""Mesh processing, with libigl, gpytoolbox and pyfqmr.

topology: edges, hinges, boundary loops, pieces, normals
predicates, intersections: exact signs; triangles that pass through each other
signed_distance, closest, geodesic, sampling, laplace, smooth: distances and functions on a surface
section, hull: where a plane cuts; the path of a taut tape
metres: surfaces of unknown unit, refused
apart: what stands beside a body
rigid: moving a mesh, or cameras, as a whole
floor: the floor under a scan
riding/: one mesh rides on another
seen/: what a camera sees of a surface
remeshing/: other triangles for the same surface
"""

import vto_pipeline.numerics  # noqa: F401  # loads Numba's thread pool before the first parallel loop asks for one
