"""Compiled loops over springs, elements and blocks of matrices.

Each kernel is a numba function `kernel(first, last, ...)` on a range of rows, springs or elements, which releases the
global interpreter lock; `threads.run` divides the whole range among threads. No two threads write to the same place, so
that results do not depend on their timing. Compiled code is cached on disk. Import these modules inside functions only:
numba loads slowly.

Shapes in the docstrings: dim is 2 or 3, k the number of nodes of an element, `zero` a tuple of zeros whose length (dim
unless stated) is known when a kernel is compiled. `starts` and `columns` are those of a sparse matrix in compressed
rows, shape (n + 1,) and (n_blocks,); `columns` ascend within a row.
"""
