"""Sizes of a sewing pattern.

rules, rules/: per type of garment: which panel is which part, and the steps from size to size
outline: what each edge of a panel is: shoulder, armhole, side, hem
flat: flat measurements of a garment
widths, shoulder_point: how wide panels are at a level; where on a sleeve the shoulder ends
steps, anchors: from size to size; where the anchors of a panel move
balance, morph, grade: all corners, so that seams still match; a panel moved; a pattern in other sizes
between: the size between two
"""
