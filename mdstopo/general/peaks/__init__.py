"""Peaks of responses on the method's own motion between steps, and their gradients."""
