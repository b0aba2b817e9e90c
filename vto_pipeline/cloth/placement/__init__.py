"""Placement: a start on the body without crossings.

place, orientation, voxels, voxel_fit: unit, axes and place of a garment on a body it was never on
transfer, regrade: from the body it was on to another; in the same size or in the customer's
rigid_escape, flexible_escape: the garment led about a body as a whole, or part by part
limbs: a body's limbs, the openings that are there for them, sleeves laid on arms
rigidity: cloth that keeps its shape as far as it may
way_out: what cloth inside a body asks for, so led
thinning: a body and its thinner ones, and what limbs do in a garment about them
body_growth: how a garment begins about a thin body that grows inside it
collapsed_start: a start in which no force has a direction
collision_free_start: crossings untangled, or known and left alone
clear_body: the last pass, in which no triangle may cross the body
"""
