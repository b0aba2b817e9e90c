"""Parameters of a body: shape and pose.

shape: smooth fields that stretch segments and scale sections
skinning: what the joints do to each vertex
pose: poses over the skeleton, named ones, and ways from one to another
fit: shape, pose and place together
stance: how a registered body stands
"""
