"""The known mannequin found by its outline in the photos, where too little of it was scanned.

edges: the photos as edges, from coarse to fine, and what the scan hides in them
contour: the outline of a mesh in a picture, point by point
match: the edge that belongs to each point of it
fit: Gauss-Newton steps of the placement
inside: how much of the placed scan the mannequin reaches through
search: many starts, one winner, its uncertainty, or a refusal
"""
