"""The engine: plans, runs, caches. Knows nothing of garments."""
