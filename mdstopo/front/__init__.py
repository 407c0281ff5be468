"""Fronts of several objectives, and sweeps over keys of a case: what is to be solved, where, and what came of it.

The package `plan` says what to solve next; `pool` and `cluster` spread pieces over processes or machines;
`run_front` and `run_sweep` bring them together with the result file.
"""
