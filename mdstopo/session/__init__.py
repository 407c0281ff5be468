"""A run from a case to a finished result file: start or resume, iterate, checkpoint, finish.

It knows neither mechanics nor HDF5: the engine evaluates, the optimiser steps, the store writes; this package
says when.
"""
