"""What a case is made of: immutable parts, aims, settings; where bodies are at the start."""
