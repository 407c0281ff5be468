"""Pieces of work on processes beside this one: one pool for starts, fronts and sweeps, samples, and `stress`.

`worker_pool` gives tasks out and takes results in; `worker_program` is what runs in each of the processes.
"""
