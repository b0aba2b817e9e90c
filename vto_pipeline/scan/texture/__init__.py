"""A picture on the scanned surface, from its photos.

project: the whole of it
charts: the surface laid flat
views: which photos show a texel, and how well
colors: one colour from several photos
rim: the form's colours at the garment's rims
fill: colours where no photo shows the surface
"""
