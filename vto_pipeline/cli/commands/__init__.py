"""One file a command: batch, bench, doctor, drape, fit, plan, report, run, scan, schema, stages, status."""
