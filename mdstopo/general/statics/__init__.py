"""Entries for what is found before a run begins: joints assembled, equilibrium, a response at the settled place."""
