"""Reading and writing files: the only place that touches formats and untrusted bytes.

meshes, clouds, fabrics: read any format
formats/, gltf/, fabric_formats/: one file a format; fabric_presets/: one YAML file a fabric
patterns/: sewing patterns in and out
captures/, bodies/, motion/: what cameras deliver; what is known of a body, and how it moves
runs/: the artifacts of a run
animations: moving pictures
companions: the files beside a mesh that are read with it
size_charts: flat measurements of each size
sniff: what a path holds
sandbox: untrusted bytes are parsed in a limited child process
files, arrays, documents, text_numbers: what readers and writers share
stalls: folders that do not answer
stores: object stores and web servers
lengths: the unit of a file without one
"""
