"""Rest shapes: garments without forces.

from_panels: the flat pieces of cloth that texture coordinates may be
from_hanging: the modes; found from how it hung on the body it was scanned on
edge_length_embedding: positions whose edges have given lengths
"""
