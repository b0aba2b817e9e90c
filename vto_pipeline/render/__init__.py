"""The detailed garment after the drape, and pictures.

dress, transfer: the render mesh rides on the simulation mesh
pictures, rasterise, shading, tint, marks: pictures without a display
"""
