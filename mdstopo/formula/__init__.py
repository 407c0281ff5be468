"""Formulas: a small language of expressions, its grammar, values, derivatives and simplification.

Nothing here is ever evaluated as Python. `parse` in `parser.py` makes a tree of `Expression` (`tree.py`), in which
equal parts are one object; `formula_values.py` computes with numbers, `calculus.py`
differentiates.
"""
