"""Motion. World frame: metres, +Y up, +Z forward, y = 0 the floor; quaternions are (x, y, z, w).

clip: a moving skeleton, as a file holds it
avatar_motion: the movement of one of our avatars
body_path: a body on its way, at any time
cloth_motion: a garment, frame by frame
"""

from vto_pipeline.model.motion.avatar_motion import CONTACTS, AvatarMotion
from vto_pipeline.model.motion.body_path import BodyPath
from vto_pipeline.model.motion.clip import Clip
from vto_pipeline.model.motion.cloth_motion import ClothMotion

__all__ = ["CONTACTS", "AvatarMotion", "BodyPath", "Clip", "ClothMotion"]
