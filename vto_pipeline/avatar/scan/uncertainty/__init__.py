"""How surely each measurement of a registered body is known.

observed: where the scan shows the body: levels, and the surface itself
unobserved: where the model fills in, by the model's own freedom
people: there, too: no measurement is surer than people differ in what was not seen
"""
