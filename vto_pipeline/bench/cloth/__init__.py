"""Solvers and integrators: error against run time.

scenes: the scenes, and what is measured on their last frame
solvers, integrators, iterations: every method on them
closed_forms: what each integrator does to one oscillator
comparison: rows measured elsewhere on the same scenes
"""
