"""The mannequin taken away from a scan.

floor: what is not worn
color_model: the colours of cloth and mannequin
variety: how colours vary, on a print and on a form
graph_cut: labels from evidence
thin_parts: parts of the mannequin that come out too thick
cloth_edges: where labels change at an edge of cloth, and where within cloth
subtract: over a mannequin that was scanned bare; the garment's shell
pieces: those that are worn, and how much cloth the others are
estimated: over a body that was only estimated
"""
