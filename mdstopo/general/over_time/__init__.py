"""What a response does over a finished run: who leads, kinks, minima, switches, where an integral needs more steps."""
