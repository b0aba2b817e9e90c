"""Swatches of known rigidity, and what is measured from them.

strips: hanging strips by shooting, which shares nothing with the fit, and their noise
discs: real fabrics fitted to their drape coefficients
"""
