"""Camera data.

images, exif: pictures, and what EXIF says of the lens
photos, depth: folders of photos and of depth frames
rgbd_layouts: depth frames as TUM, 7-Scenes, ScanNet and Stray Scanner lay them out
cameras: cameras.json, sparse reconstructions, depth maps
"""
