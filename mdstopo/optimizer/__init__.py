"""GSAO, the optimiser. Nothing here knows mechanics; nothing is imported before it is needed.

problem        what an optimiser may know: bounds, linear rows, samples with competing rows and gradients
options        the table of single settings; presets: named ones, and their validation
driver         the loop, one evaluation a step; state: all it remembers, in arrays
separable      the method that begins where one row decides, bundle_method: where rows compete; the driver chooses
approximation  the convex separable model; subproblem: its solution, by `dual` in closed form where one row
               allows it, else by `interior` (a primal-dual interior point, iterated by `interior_kernels`); `wide`: of
               very many
rows           the bundle method's model, of the rows in `bundle` and `curvature`, solved by `conic`
safeguards     merit, trust box, shifts, convex term, stops
projection     the nearest feasible design; starts: several runs from different designs
"""
