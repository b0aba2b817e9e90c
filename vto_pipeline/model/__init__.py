"""The data model: frozen dataclasses of arrays, validated on construction. No algorithms.

mesh, camera, frames: surfaces, clouds and captures
body, garment, pattern, outfit, fabric, cloth: what is fitted and draped
motion/: how a skeleton moves, and how an avatar does
render, texture: what is drawn; a surface with a picture on it
artifact, job, settings, arrays: how nouns are kept; long work; the base of settings; checks
"""
