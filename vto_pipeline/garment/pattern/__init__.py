"""Sewing patterns as garments.

figures: areas and lengths of panels, and how well the two sides of each seam match
"""
