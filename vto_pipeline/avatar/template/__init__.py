"""The template: fixed topology, female to male, in the A-pose.

template: the template as it is loaded
regions: which vertices belong to which part
body_plan, implicit, grid: sections, the surface they blend into, and its connectivity
build: make template.npz again
"""
