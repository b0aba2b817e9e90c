"""What a camera sees of a surface.

depth_picture: how far away it is, pixel by pixel
looked_through: how many cameras see through a place to what is behind it
"""
