"""Strips of known rigidity, curl and tilt, simulated with noise, and what is measured from them.

strips: shapes by shooting, which share nothing with the fit, and their noise
"""
