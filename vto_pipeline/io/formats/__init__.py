"""Mesh and cloud formats, one file each.

obj, obj_parts, mtl, off, stl, ply, ply_header, pcd, pts, xyz, las, e57: the formats (glTF has a folder of its own)
atlas: pictures from files, and several of them as one
polygons: polygons to triangles
clean_up: a mesh made sound, every change reported
"""
