"""Contact with triangle-mesh bodies that may move.

contacts: the cloth's contacts with it
nearest, walk, ray_march, triangle_planes, crease: where it is touched
clean, visible: bodies that are neither closed nor free of crossings
yielding: bodies that give way where their own parts press on each other
"""
