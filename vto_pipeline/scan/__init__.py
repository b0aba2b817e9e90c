"""From photos, depth frames and clouds to a surface in metres.

photos/, depth/: cameras and depth, from each kind of capture
keyframes: photos from a video
fuse: one surface from many depth maps
normals, surface: a surface through an unorganised cloud
upright, similarity: which way is up; one set of points mapped on another
library_message: what COLMAP, OpenCV and Open3D say when they fail
canonical: one order for what hash tables give in any order
"""
