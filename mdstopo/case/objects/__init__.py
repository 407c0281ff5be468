"""What a case is made of: immutable parts of scenes and of the problem, settings; where bodies are at the start."""
