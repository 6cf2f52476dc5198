"""Compiled loops over springs, elements and blocks of matrices: numbers in, numbers out, no physics of their own.

Each is a numba function `kernel(first, last, ...)` on a range of rows, springs or elements that
releases the interpreter's lock; `threads.run` cuts the whole range into one piece a thread. What a
piece writes is its own, so that results do not depend on which thread is faster. Compiled code is
kept on disk. The rest of the house imports these modules inside functions only: numba loads slowly.
"""
