"""Motions and garments in motion, each a command of its own.

__main__: how clean motions come out on five bodies
limb_angles: how far limbs point from where the source's do
tracked: the same motions given as places of their joints
live: the garment of a stream, beside the accurate one
garments: garments carried through motions: crossings, stretch, time per frame
ipc_frames: the frames of these that cross, by ipctk
"""
