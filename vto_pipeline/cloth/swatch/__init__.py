"""A fabric's bending rigidity from strips that hang over a table's edge.

fit: from profiles, or from one angle, to the rigidity and its interval
strip: a profile; what strips say of a fabric
problem: the unknowns and the distances
elastica: the shape of a heavy strip with curl
noise: what the residuals say of noise that neighbours share
"""
