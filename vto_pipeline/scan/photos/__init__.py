"""From photos to posed cameras and dense depth.

features, mapping, triangulation, sfm: matches, cameras and sparse points
board, scale: metres, a floor and an origin from a printed board
neighbours, rectify, disparity, subpixel, consistency, stereo: dense depth
coverage: how much of what the photos see has depth
"""
