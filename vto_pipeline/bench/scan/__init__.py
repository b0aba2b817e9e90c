"""Scans of captures whose garment is known: how near they come, and what they cost.

captures: capture folders on the command line, a row each
truth: a scanned garment beside the true one
blame: how much of its error was filled, seen wrong, or shown by no photo
shown_rims: where it ends, beside where photos show that the cloth ends
withheld: garment and form parted without a scan of the bare form
levels: what each level of a stage saves and costs
look, drawn, likeness: a textured garment beside photos that it was not made from
"""
