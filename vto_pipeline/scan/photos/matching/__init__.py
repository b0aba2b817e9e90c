"""From photos to cameras and sparse points, by COLMAP.

fixed_camera: a background that stays where it is, found by its matches
still_background: which pixels show it, so that it can be painted over
best_grey: the grey in which few features become many
features: features, and pairs of photos that share them
mapping: cameras and points from the pairs
board_poses, from_board: the same where features are too few, and photos show the board
nearest, guided: features matched where the places of two photos say, exactly
ties: photos that too few points tie to the others
tracks, adjust: many more points followed from photo to photo, and the cameras adjusted to them
certainty: how far off photos may show what they look at, by what their sightings leave open
"""
