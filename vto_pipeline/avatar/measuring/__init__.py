"""Measurements of an avatar, and their statistics in the population.

definitions: what each measurement means, with its clause in ISO 8559-1
tape: each measurement as a function of the vertices, with its derivative
population: ANSUR II: what some measurements say of the rest
growth: children, by the statistics of adults
measuring_levels: where the body itself shows waist, bust and seat
avatar_measurements: all of them, with uncertainties
"""
