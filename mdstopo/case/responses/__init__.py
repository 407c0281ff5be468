"""Responses, which are numbers of a state over time; their units, and what columns of states are called."""
