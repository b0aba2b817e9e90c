"""Parameters of a body: shape and pose.

shape: smooth fields that stretch segments and scale sections
pose: skinning over the skeleton
fit: shape, pose and place together
stance: how a registered body stands
"""
