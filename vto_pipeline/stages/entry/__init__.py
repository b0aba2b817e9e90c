"""The ways in to the tables, for the command line and for Python.

commands: scan, fit, drape and run
documents: the pipeline document that each of them stands for
planning: the tables, and the request and the plan of a document
batches: the rows of a batch, planned, and finished at once where all is stored
outcome: what a run made, and what it says
shown, pictures: what of it can be drawn, and a small picture of that
cards: what a notebook shows of it
moving: its garment and avatar in motion, frame by frame
live: the same, moved by a person before a camera
pace: when the frames of that begin
try_ons: a batch of drapes as a page with sliders
"""
