"""From depth frames to the camera's path.

depth_mask: readings that are wrong by nature
tracker, pose_guess, rgbd_alignment: motion between two frames
odometry, pose_graph: the whole path, loops closed
"""
