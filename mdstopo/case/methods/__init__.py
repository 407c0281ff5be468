"""Methods that a case names by a word: integrators, methods of differentiation, reductions over time, measures, distributions, losses. One record each."""
