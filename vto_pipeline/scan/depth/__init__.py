"""From depth frames to the camera's path.

depth_mask: readings that are wrong by nature
rgbd_frame: a frame as planes, with normals and brightness
tracker, pose_guess, rgbd_alignment: motion between two frames
odometry, pose_graph, bundle: the whole path, loops closed, all keyframes refined together
contradiction: frames that were placed wrongly, known by what others see through
"""
