"""Run time against size.

sizes: at equal error from 1k vertices up
throughput, roofline: inner kernels beside what the machine can do
overhead: what threads cost
batches, workers: what a row of a batch costs besides its work; rows side by side
forecasts: the cost model against what runs took
gpu/: the same systems and sweeps on a graphics processor
direct_solvers: our Cholesky beside MKL PARDISO and SuperLU
"""
