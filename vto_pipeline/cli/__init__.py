"""The command line; it holds no algorithms.

main: the command `vto`, and the one place where errors become messages
commands/: one file a command
work: what run, scan, fit and drape share
results: what a run found, in words
options, session, progress, tables: options, streams, bars, tables
setup_system: what the system must hold before the package can be installed
"""
