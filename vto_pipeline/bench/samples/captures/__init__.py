"""Synthetic photos, depth frames and clouds.

studio, viewpoints, board, textures: the scenes
render, photos, depth, cloud: the sensors
"""
