"""Garments of known cut taken apart, and their patterns held against that cut.

compare: one pattern against the true panels
scans: a scan that is simulated, of a drape whose pattern is known
redrape: patterns that were found put on again, and held against their scans
"""
