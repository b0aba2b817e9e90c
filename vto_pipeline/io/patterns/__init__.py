"""Sewing patterns.

read, write: any format in; DXF, SVG and JSON out
record: our own JSON, panels.json
garment_code: JSON of GarmentCode and Garment-Pattern-Generator
seam_lines: seams drawn on a garment
sewing_plan: in words, where panels stand and what is sewn to what
panels_obj: a garment with its panels as texture coordinates
dxf/, svg/: one folder a format
loops: pieces of outlines joined into closed ones
fold: panels mirrored, and half a panel opened at its fold
"""
