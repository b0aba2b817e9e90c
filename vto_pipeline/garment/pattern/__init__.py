"""Sewing patterns as garments.

figures: areas and lengths of panels, and how well the two sides of each seam match
planned: pieces cut, placed and sewn as a plan says
finish: grain lines, notches and cut lines for the cutter
sampling, triangulate, sew: edges in samples, panels in triangles, seams welded
where: panels in space, flat or as they were worn
folds: seams that panels are folded at
embed: the sewn mesh bent in space without stretch
"""
