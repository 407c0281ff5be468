"""Optimisers: GSAO, with its bundle method. Nothing here knows mechanics; nothing is imported before it is needed.

problem           what an optimiser may know: bounds, linear rows, samples with competing rows and gradients
interface         the three functions of an optimiser; state: what all of them remember between two iterations
gsao              its loop, one evaluation a step; gsao_state: all that it remembers beside
separable         the method that begins where one row decides, bundle_method: where rows compete; `gsao` chooses
approximation     the convex separable model; subproblem: its solution, by `dual` in closed form where one row
                  allows it, else by `interior` (a primal-dual interior point, iterated by `interior_kernels`); `wide`:
                  of very many variables
competing_rows    the bundle method's model, of the rows in `bundle` and of `curvature`, solved by `conic`
safeguards        trust box, shifts, convex term, stops; violations: how far limits are missed, and the merit
scalarisation     several objectives as one
nearest_feasible  the nearest feasible design; start_families: the first designs of several runs

Settings with their options and presets stand in `settings`.
"""
