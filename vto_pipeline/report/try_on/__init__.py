"""The page of a grid of drapes: sliders between them, at once.

between: the shape between drapes, how far it misses a drape, and how deep it is in the body
page: the page
"""
