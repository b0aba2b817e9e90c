"""Mesh and cloud formats, one file each.

obj, off, stl, ply, ply_header, pcd, pts, xyz, las, e57: the formats (glTF has a folder of its own)
polygons: polygons to triangles
clean_up: a mesh made sound, every change reported
"""
