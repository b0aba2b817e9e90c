"""From photos to cameras and sparse points, by COLMAP.

fixed_camera: a background that stays where it is, found by its matches
features: features, and pairs of photos that share them
mapping: cameras and points from the pairs
"""
