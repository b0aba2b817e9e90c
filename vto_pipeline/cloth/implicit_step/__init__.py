"""Shared parts of implicit methods: the system of one step and its solution.

prediction: where vertices go when nothing holds them
stiffness: the matrix of a step, and its exact form
linear_system: conjugate gradients or a sparse factorisation
lacking: a solution completed by what the factored matrix lacks
rest_ahead: how far rest is
dual_system: the step linearised in the multipliers of its constraints
geometric_stiffness: how gradients turn while multipliers grow
iterated: what methods share that iterate on one step at a time
line_search: how far a descent step may go
plane_multiplier: contact inside an iteration, remembered
dissipation: what dampers take out of a step
momentum: kept to the last bit where nothing holds the cloth
frozen_step: one step as a fixed problem, for comparing solvers
"""
