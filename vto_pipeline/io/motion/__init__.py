"""Motion.

read: any format in; presets/: named poses and a step
bvh, bvh_hierarchy, bvh_frames: BVH in every dialect
gltf_animation, gltf_samplers: animated skeletons of glTF
smpl_poses: pose sequences of the SMPL family; keyframes: poses in YAML, both over standard_skeleton
tracked/: joints that a camera follows, as JSON lines
gaps: frames that are lost
joint_map, joint_names.yaml, skeleton_form: which joint is which, by name or by the form of the skeleton
upright: unit and up axis
archive: an avatar's motion, out and in
"""
