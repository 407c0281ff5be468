"""Rigid bodies at the start, rotations, point grids, and what is drawn of bodies."""
