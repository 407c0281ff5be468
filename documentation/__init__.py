"""What the documentation generates when it is built: the keys of a case, the commands, formulas as MathML."""
