"""One file a command: batch, bench, doctor, drape, fit, info, plan, prune, report, run, scan, schema, stages, status."""
