"""Format 1 of the case file: every key, its limits, default and meaning; JSON Schema and tables made of it."""
