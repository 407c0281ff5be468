"""Sections on top of scene and design: objectives and constraints, solver and optimiser, fit, uncertainty."""
