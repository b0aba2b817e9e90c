"""One file a command.

scan, fit, drape, run, batch: what makes something
pattern/: a sewing pattern measured, and written in another format or in other sizes
between/, advise/: the size between two; which size to take
fabric/: a fabric measured from its strips
motion/: a motion measured, and carried over to an avatar
stream/: avatar and garment moved live
tryon/: sliders between the drapes of a batch
status, info, plan, stages, schema, doctor: what only looks
report, prune, cancel, bench: the page again, room on the disk, an end, measurements
view/, render/: the page in the browser; pictures
"""
