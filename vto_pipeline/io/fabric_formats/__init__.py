"""Formats of fabric files: measured values in textile units, converted to SI.

document: this package's own file
sheets, kes, fast, u3m: the sheets and files of test instruments
curves, assumed: stretch curves; what is worked out or assumed, and why
drape_photo: a drape test seen from above
strip_profiles: points along a strip that hangs over an edge
"""
