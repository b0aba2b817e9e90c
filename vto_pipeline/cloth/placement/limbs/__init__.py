"""A body's limbs, and a garment's openings for them.

limbs: where arms, legs and head join the trunk
openings: which opening is there for which limb, and what the limbs go through
lead: sleeves laid on arms, legs on legs
"""
