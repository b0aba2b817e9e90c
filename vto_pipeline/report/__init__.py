"""The report: one page with a 3D view.

page, tables, wording, verdicts, chart: the page and its parts
document: a page from its template, all in one frame
budgets: what a run bought with its budgets, in words
batch/: the summary of a batch
card, facts: a card for notebooks; the numbers of a surface
scene, layers, packing, scales, render_colors, body_loops: its 3D view
live/: a view of what moves now
try_on/: sliders between the drapes of a grid
"""
