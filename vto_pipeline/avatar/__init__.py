"""The parametric body.

from_measurements, from_scan, from_silhouettes: the three ways to an avatar
from_dressed: a mannequin inside the scan of what it wears
measure: measure any body
open_mesh: a mesh that is open as a garment is has to be a person's
standing: a body mesh by others, with the axis up along which it stands
template/: fixed topology, and how it is built
model/: shape and pose
motion/: how an avatar moves as another skeleton does
measuring/: what each measurement means, the tape that reads it, and the population
scan/: registration to a scan, and how sure the result is
lifelike/: face, fingers and toes for pictures
silhouettes/: outlines in two photos
"""
