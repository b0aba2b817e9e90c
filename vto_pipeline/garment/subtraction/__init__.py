"""The mannequin taken away from a scan.

floor: what is not worn
color_model: the colours of cloth and mannequin
graph_cut: labels from evidence
subtract: over a mannequin that was scanned bare; the garment's shell
estimated: over a body that was only estimated
"""
