"""The detailed garment after the drape, and pictures.

dress, transfer: the render mesh rides on the simulation mesh
pictures, shading, tint, marks: pictures without a display
"""
