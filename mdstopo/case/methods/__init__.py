"""What a case names by a word, one record each: integrators, methods of differentiation, reductions over time,
measures, distributions of uncertain numbers, losses of fits."""
