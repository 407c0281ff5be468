"""One start of the optimiser on a compiled case: what it needs of the engine, its kernels made ready, where the start
begins, and which of several go on.
"""
