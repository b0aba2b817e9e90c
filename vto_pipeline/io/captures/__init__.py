"""Camera data.

images, heic, exif: pictures, and what EXIF says of the lens
photos, depth: folders of photos and of depth frames
video: a video, from which photos are taken
photo_archive: photos that a stage has made
rgbd_layouts: depth frames as TUM, 7-Scenes, ScanNet and Stray Scanner lay them out
cameras: cameras.json, sparse reconstructions, depth maps
"""
