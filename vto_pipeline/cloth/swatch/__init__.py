"""A fabric's bending rigidity from strips that hang over a table's edge, or from a disc that hangs over a smaller one.

fit: from profiles, or from one angle, to the rigidity and its interval
scanned: a profile from a scan of a strip
strip: a profile; what strips say of a fabric
problem: the unknowns and the distances
elastica: the shape of a heavy strip with curl
noise: what the residuals say of noise that neighbours share
disc: the drape test of Cusick, simulated
fit_drape: from a drape coefficient to the rigidity and its interval
meshes: flat strips and discs
"""
