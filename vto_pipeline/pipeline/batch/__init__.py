"""Many runs of one document, each with its own changes.

order: from a batch document and its table to the documents of all rows
table: the rows of a table, as any spreadsheet saves it
roots: what a batch from strangers may read
inputs, publish: what is given in object stores, copied here; what was made, copied there
row: one row in a process of its own, within limits of memory and time
cluster: all rows on the workers of dask.distributed
grid: the rows as every combination of what they differ in
time_left: the forecast of what is still to run
ledger: batch.json, batch.csv and the journal of rows that have ended
summary: the columns of every table of rows, and failures of one kind together
"""
