"""Camera data.

images, exif: pictures, and what EXIF says of the lens
photos, depth: folders of photos and of depth frames
cameras: cameras.json, sparse reconstructions, depth maps
"""
