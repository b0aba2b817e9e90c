"""Sewing patterns of our own drawing, cut to a body's tape.

tape: the measures that they are drawn from
pieces: outlines, and where they stand about the body
tops, bottoms: the garments
wardrobe: all of them by name
"""
