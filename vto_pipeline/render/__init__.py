"""The detailed garment after the drape, and pictures.

dress, transfer: the render mesh rides on the simulation mesh
carry_skin: the picture of a scanned surface on the garment cut out of it
clear_body, tuck: none of it inside the body; a lifelike body inside the cloth
web: the render mesh within the limits of a web page
pictures, frames: pictures without a display, and what they frame
pixels: the kernel that draws them
shading, shadows, surface_colors, tint, marks: how surfaces look in them
"""
