"""Files about bodies.

measurements, size_letters: tapes, sizes, silhouettes, landmarks
avatars: the avatar's archive
skinned, smpl, makehuman: bodies with a skeleton, made by others
makehuman_library: all of MakeHuman's shapes, where they are installed
"""
