"""GSAO, the optimiser. Nothing here knows mechanics; nothing is imported before it is needed.

problem        what an optimiser may know: bounds, linear rows, samples with competing rows and gradients
options        the table of single settings; presets: named ones, and their validation
driver         the loop, one evaluation a step; state: all it remembers, in arrays
approximation  the convex separable model; subproblem: its solution, by `dual` in closed form where one row
               allows it, else by `interior` (a primal-dual interior point, iterated by `kernels`)
safeguards     merit, trust box, shifts, convex term, stops
projection     the nearest feasible design; starts: several runs from different designs
"""
