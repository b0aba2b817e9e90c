"""From photos, depth frames and clouds to a surface in metres.

photos/, depth/: cameras and depth, from each kind of capture
texture/: the photos laid on the surface
keyframes: photos from a video
exposure, grey: how brightly each photo was exposed, and in which grey its print shows best
fuse, level_set: one surface from many depth maps
depth_views: maps that are read when they are needed
disagreement: the error to expect, from how far the maps are from their surface
object_sphere: what the cameras look at, without the room
normals, surface: a surface through an unorganised cloud
upright, similarity: which way is up; one set of points mapped on another
library_message: what COLMAP, OpenCV and Open3D say when they fail
canonical: one order for what hash tables give in any order

Called, it does what `vto scan` does: package and command share a name.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import Any


class _Command(ModuleType):
    """A package that is called as the command of its name."""

    def __call__(self, *args: Any, **settings: Any) -> Any:
        """See `vto_pipeline.api.scan`."""
        return import_module("vto_pipeline.api").scan(*args, **settings)


sys.modules[__name__].__class__ = _Command
