"""A body from a front and a side photo.

backdrop: one person before a plain backdrop
outline: where a silhouette runs in a picture
initial_pose, fit: begun from the mean body, then Gauss-Newton on both outlines
"""
