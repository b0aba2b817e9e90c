"""The command line; it holds no algorithms.

main: the command `vto`, and the one place where errors become messages
commands/: one file a command
interrupts: Ctrl-C and SIGTERM, wherever they arrive
results: running a document, and what it found, in words
describe: what a file or folder holds
options, session, progress, tables: options, streams, bars, tables
setup_system: what the system must hold before the package can be installed
"""
