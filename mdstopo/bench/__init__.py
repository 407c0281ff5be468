"""Measuring the program with itself: cost against size, work against precision, and what is left out."""
