"""Rest shapes: garments without forces.

from_hanging: found from how it hung on the body it was scanned on
edge_length_embedding: positions whose edges have given lengths
"""
