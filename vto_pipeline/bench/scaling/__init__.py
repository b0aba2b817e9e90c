"""Run time against size.

sizes: at equal error from 1k vertices up
throughput, roofline: inner kernels beside what the machine can do
overhead: what threads cost
direct_solvers: our Cholesky beside MKL PARDISO and SuperLU
"""
