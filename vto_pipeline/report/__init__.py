"""What a person reads at the end: one page with a 3D view, and plots of error against run time."""
