"""What a camera sees of a surface.

depth_picture: how far away it is, pixel by pixel
"""
