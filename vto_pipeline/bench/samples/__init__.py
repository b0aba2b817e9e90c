"""The sample data and its truth, generated."""
