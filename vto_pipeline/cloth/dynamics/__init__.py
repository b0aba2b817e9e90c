"""Time stepping of cloth among colliders.

methods: the table of all solvers and integrators, and the default choice
stepper: spans short enough for the contacts found at their start
residual: the residual force, however the cloth got there
body_motion: a moving body, no faster than the cloth on it can follow
step_length: longer steps where the motion allows
step_refinement: steps halved until halving changes no more than the stated error
warm_up: compile the kernels before the clock starts
"""
