"""Derivatives by the design: by members' alpha, values of laws, and what else varies."""
