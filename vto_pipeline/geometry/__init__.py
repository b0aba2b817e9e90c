"""Meshes as shapes: topology, distances, repair, remeshing. The home of libigl, gpytoolbox and pyfqmr."""

import vto_pipeline.numerics  # noqa: F401  # loads Numba's thread pool before the first parallel loop asks for one
