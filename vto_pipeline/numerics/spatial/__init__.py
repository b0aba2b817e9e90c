"""Spatial search structures.

boxes, morton: boxes along the axes; order along a space-filling curve
bvh, bvh_pairs: a tree of boxes over triangles, and the pairs that overlap
pair_lists: lists filled by several threads
pseudonormals: normals whose sign tells inside from outside
"""
