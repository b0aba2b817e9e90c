"""Motion. World frame: metres, +Y up, +Z forward, y = 0 the floor; quaternions are (x, y, z, w).

clip: a moving skeleton, as a file holds it
avatar_motion: the movement of one of our avatars
"""

from vto_pipeline.model.motion.avatar_motion import CONTACTS, AvatarMotion
from vto_pipeline.model.motion.clip import Clip

__all__ = ["CONTACTS", "AvatarMotion", "Clip"]
