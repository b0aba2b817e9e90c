"""Sewing patterns, of our own drawing and by others, sewn and draped on bodies.

__main__: the table
seams: how far apart the two sides of each seam are in the drape
crossings: of a drape, by ipctk
"""
