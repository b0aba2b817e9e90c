"""One file a command.

scan, fit, drape, run, batch: what makes something
status, info, plan, stages, schema, doctor: what only looks
report, prune, cancel, bench: the page again, room on the disk, an end, measurements
"""
