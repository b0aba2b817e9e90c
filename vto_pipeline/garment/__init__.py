"""From a scanned surface to a garment.

align, alignment/: the scan in the frame, and if need be the scale, of its mannequin
outline/: the mannequin found by its outline in the photos
subtraction/: the mannequin taken away
loop_evidence, bare_parts, told_apart, notches, rims, openings: real openings kept, scan holes filled
lifting: fillings kept off the mannequin
pierced: fillings that a part of it goes through, opened there
open_seams: rims that run along each other, sewn
simulation_mesh: the mesh that is simulated
photographed/: the garment held beside the photos
wearable: whether a surface can be a garment at all
pattern/: sewing patterns as garments
unsewn/: from a garment in space back to its pattern
sizes/: flat measurements of a pattern, and the pattern in other sizes
"""
