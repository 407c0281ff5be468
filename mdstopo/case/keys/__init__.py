"""What keys are made of: kinds of single values, records and lists of them, rows of numbers, formulas."""
