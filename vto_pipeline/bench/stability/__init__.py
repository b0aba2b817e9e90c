"""Stiff, distorted and extreme cases: every method on each.

table: the rows
case, trial: one case; one method on it, guarded
sheets, strands, worn, refused: the cases
limits, frequency: the largest step of explicit methods
"""
