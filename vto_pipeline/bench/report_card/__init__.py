"""What results say as a whole.

fronts: error against run time, what nothing beats, and where today's default stands
changes: what got better or worse since earlier results
"""
