"""What every method of integration has: its interface, the history of steps, how runs begin, steps linearised."""
