"""Camera data.

images, heic, exif, undistort: pictures, what EXIF says of the lens, pictures without its distortion
photos, depth: folders of photos and of depth frames
video: a video, from which photos are taken
photo_archive: photos that a stage has made
rgbd_layouts: depth frames as TUM, 7-Scenes, ScanNet and Stray Scanner lay them out
cameras: cameras.json, sparse reconstructions, depth maps
"""
