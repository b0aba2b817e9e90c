"""Sample garments of known cut.

wearer: whom they are cut for
tailoring, folds: from a field to a garment
shirt, top, skirt, trousers, wardrobe: the garments, and all by name
"""
