"""Scenes at the edges of what can be computed, each against an independent value: `mdstopo stress`."""
