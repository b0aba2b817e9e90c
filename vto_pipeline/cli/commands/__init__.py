"""One file a command: bench, doctor, drape, fit, plan, report, run, scan, schema, stages."""
