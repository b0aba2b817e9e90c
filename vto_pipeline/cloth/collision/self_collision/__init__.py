"""Self-collision: candidates, contact pairs, and safe steps.

surface_features, pieces: what of a surface can touch
candidates: broad phase over swept boxes
pairs: vertex-face and edge-edge pairs to be kept apart
body_features: the vertices and edges of a body against the cloth's faces and edges
proximity_bound: a proof that no search is needed
safe_step: the largest part of a move that lets nothing through
self_contact: all of it for one cloth
counters: what it took, and what was left out
"""
