"""The sample data and its truth, generated.

make: which files there are, and in which order they are made
customer: the customer
garments/, solids/, captures/: what is worn, its surfaces, and the cameras
patterns/: sewing patterns cut to a body
"""
