"""Other programs on the same scenes, each as its expert user would write it, in one interleaved run with mdstopo."""
