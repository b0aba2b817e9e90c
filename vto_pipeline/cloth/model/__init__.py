"""The model of a cloth: the constants that a solver works on.

build: mesh, rest shape and fabric to a model (constant) and a state (varying)
coarsening: the garment in fewer triangles, and back
materials: which constraints stand for a fabric
internal_friction: the sliders that remember friction and plasticity from step to step
settings: settings given as a plain mapping from Python
"""
