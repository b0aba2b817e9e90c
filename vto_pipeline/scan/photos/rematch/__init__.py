"""A second look at what stereo missed: surface seen at a slant, or by few photos, whose place can be guessed.

guess: a closed surface through the confirmed depths, and which of it no depth map shows
patches: how well photos agree on small patches along their normals
smooth_choice: one offset for each patch, near its neighbours'
look: one look along a guess; rematch: look after look, back into depth maps
fillings: a look at cloth that was filled
"""
