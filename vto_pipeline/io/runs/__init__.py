"""The files of a run.

artifacts: the table of all artifacts, their names and how they are kept
garments, traces: labels, openings, rest shapes; error against run time
textures: a surface with its picture
frame_log: a garment in motion, kept as its frames come
"""
