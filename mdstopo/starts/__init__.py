"""One start of the optimiser on a compiled case: what is asked of the engine, its kernels made ready, where the start
begins, and which of several go on.
"""
