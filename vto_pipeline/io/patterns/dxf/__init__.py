"""DXF files of pattern makers: AAMA-292 and ASTM D6673, through ezdxf.

read: a file as a pattern
entities, texts: what a block holds, in curves and in words
piece: a block as a panel
borders: where one edge of an outline ends and the next begins
stitch_texts, placement_text, remarks: stitches, where a panel stands in space, names of edges, in words
write: a pattern as a file of release 12
layers: what lies on which layer
"""
