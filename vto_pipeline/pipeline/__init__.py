"""The engine: plans, runs, caches. It knows nothing of garments.

stage, levels, catalogue: a row of the table, what it may be run at; the tables an engine works on
given, request, schema: from a document to a checked request
plan, lacking: walking backwards from what is wanted to what is given
execution/: running a plan
batch/: running many
"""
