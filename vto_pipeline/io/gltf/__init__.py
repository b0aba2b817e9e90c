"""glTF 2.0 and GLB.

document: chunks, buffers and accessors, checked against the bytes
read, skin: triangles of a scene; skeletons at rest
pictures: base colours of a scene's parts, as one picture
draco: compressed meshes, unpacked
write, animate: parts with normals, colours, textures and materials; an avatar that moves, and its garment
principal_shapes: frames of a moving surface as few shapes that are added up
quantise, web: coordinates in two bytes each; a file within a web page's limits
"""
