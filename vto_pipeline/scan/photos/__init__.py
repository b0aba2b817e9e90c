"""From photos to posed cameras and dense depth.

matching/, triangulation, region, sfm: matches, cameras and sparse points, without what surrounds the object
board, lengths, stature, scale: metres from a printed board, with floor and origin, or from what the user states
views, neighbours, rectify, disparity, subpixel, consistency, stereo: dense depth
rematch/: a second look at what stereo missed
coverage: how much of what the photos see has depth
"""
