"""In-plane strain of triangles.

triangle, yarns, slivers: what all membranes share
stretch: linear along warp and weft
green: St. Venant-Kirchhoff
curve: measured curves of force against strain
strain_limit, strain_friction: limits and internal friction
"""
