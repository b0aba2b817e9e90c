"""Motion of an avatar.

retarget: from a clip to an avatar's motion: the way in
align: turns and places carried over from another skeleton
limits, joint_limits.yaml: how far joints turn
soles, plants: where a foot touches the floor, and when it stands still
foot_skate, leg_reach: feet that stand still are held there
room: limbs and trunk that are kept off each other
calm: jerks that are smoothed away
joint_places: where joints are in many poses
timing: another frame rate; a smooth start from a pose, and a smooth end; a last pose that is held
path: the avatar at any time of its motion
live: an avatar that follows a person frame by frame
balance: mass of the parts, zero moment point, support
hips_aside: hips that move aside to keep the balance
figures: drift of planted feet, spikes, floor, crossings
"""
