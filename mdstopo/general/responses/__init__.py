"""Values of responses at an instant, their slopes, and the rows that peaks are."""
