"""Values of responses at an instant, and their slopes; the rows that peaks are noted in; zeros of sampled functions."""
