"""Contact response of the methods.

active_set, contact_springs: inside the system of an implicit step
step_response: after a step of any solver
projected_gauss_seidel: after a step of a method that knows no pairs
penalty: as spring, damper and friction forces
plane_motion: where a contact plane is at some time of its span
"""
