"""A body's limbs, and a garment's openings for them.

limbs: where arms, legs and head join the trunk
openings: which opening is there for which limb, and what the limbs go through
mittens: hulls about their ends, since fingers and toes come through coarse cloth
lead: sleeves laid on arms, legs on legs
"""
