"""A draped garment on a body that moves.

follow: frame by frame: the way in
frame: one frame: steps, and what is done where it fails
skins: how far cloth keeps from the body
path_collider: the body, posed when it is asked for
frame_audit: what each frame is judged by
config: settings
live, live_body: as fast as the body moves, before a camera
"""
