"""Running a plan.

run: each stage from the cache, or made, recorded and published
sharing, pace: levels of stages that fit into a time; how slow this machine is
key, digest, store: what decides a result, and where it is kept
folder, out, final: the folder of a run and what is published there
record, cost, listener: run.json, wall time and memory, progress
budget: wall time, shared out over the stages of a run
forecast, cost_model: what a run would do, and how long that takes by what earlier runs took
"""
