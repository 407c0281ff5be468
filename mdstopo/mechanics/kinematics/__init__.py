"""How bodies are placed and move: what of it the plane and space have in common, and what each does."""
