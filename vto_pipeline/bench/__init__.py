"""Sample data with truth, and measuring against it."""
