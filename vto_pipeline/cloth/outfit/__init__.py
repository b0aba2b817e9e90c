"""Several garments, in layers.

layers: put on one by one, then at rest jointly
combined_cloth: several garments as one cloth
body_with_layers: body and worn garments as one solid, for the next layer
audit: the judge on several garments
"""
