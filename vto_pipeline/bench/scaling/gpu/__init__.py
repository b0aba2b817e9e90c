"""What a graphics processor would bring to a drape: `python -m vto_pipeline.bench.scaling.gpu`.

systems: linear systems that a simulation meets, kept in a file
layout: the same matrix as a graphics processor reads it best, by domains
device, kernels.cu: conjugate gradients and sweeps of XPBD on the graphics processor
cusolver: the sparse Cholesky factorisation of its vendor
__main__: rows for both, and for our own code on more and more threads
"""

TRADE = "run time of the same work elsewhere; residuals stand beside it"
