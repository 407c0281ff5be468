"""Compiled code: made by Numba once, kept on the disk, loaded and called without it."""
