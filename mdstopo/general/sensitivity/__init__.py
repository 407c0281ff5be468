"""Methods of differentiation: the adjoint sweep over all rows, direct, iterative and constant load."""
