"""The optimiser's options and presets: what a case may say of it, below both, so that neither imports the other."""
