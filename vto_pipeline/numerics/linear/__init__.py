"""Sparse symmetric linear algebra in 3 x 3 blocks, the same bits for any thread count.

block_matrix, links: the matrix, and couplings beside its pattern
conjugate_gradients, multigrid: iterative solution
direct: a direct solver for one pattern
cholesky, elimination, elimination_tree, substitution, product_tile: its multifrontal factorisation
coloured_blocks: parallel Gauss-Seidel
"""
