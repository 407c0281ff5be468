"""Designs for what is not known for certain: a fixed sample of the case, evaluated as one.

`sample` makes the points, `sampled_case` the case at one of them, `robust_measures` one number of many, `ensemble`
evaluates, `points_in_workers` does so in several processes, `conclusion` says at the end what became of it.
"""
