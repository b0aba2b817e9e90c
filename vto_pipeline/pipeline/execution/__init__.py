"""Running a plan.

run: each stage from the cache, or made, recorded and published
key, digest, store: what decides a result, and where it is kept
folder, out, final: the folder of a run and what is published there
record, cost, listener: run.json, wall time and memory, progress
budget: wall time, shared out
forecast, cost_model: what a run would do, and how long that takes by what earlier runs took
"""
