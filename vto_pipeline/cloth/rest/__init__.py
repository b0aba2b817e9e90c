"""Settling of a cloth to rest, and its distance from rest.

phases: the phases of one drape: freed, grown into, ridden along, settled
multiresolution: rest on coarser meshes, and with softer threads, first
softened: cloth with softer threads
convergence: waiting for rest to a stated error
foresight: whether cloth that hardly moves is stable, and how far from rest
stable_newton: the last steps, with the exact stiffness
true_distance: how far each look was from the end
equilibrium: Newton on the potential energy, without contact
"""
