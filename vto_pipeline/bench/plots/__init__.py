"""Plots of benches, as PNG.

figure, panels: the look, and several panels in one picture
lines: error against run time, size or step
body_plot, collision_plot, drape_plot, scaling_plot, verdict_table: one bench each
"""
