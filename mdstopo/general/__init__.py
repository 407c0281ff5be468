"""Scenes in full generality: joints, prescribed motions, every member law, every response.

Scenes of springs between free bodies whose responses are stored energies have kernels of their own (`mechanics`,
`integrators`, `sensitivity`), which know nothing of what is here. This package computes everything else, and the same
scenes too, by its own formulas, so that the two families check each other.

Its folders, from what Python calls down to the arrays; imports point downwards (`.importlinter`):

    driver        evaluates a compiled scene      peaks         responses between steps
    at_rest       where a motion starts           sensitivity   adjoint, direct, iterative, constant load
    over_time     a response over a whole run     integrators   steps through time, and these linearised
    scene         from a case to arrays           events        members that switch
    pricing       candidates that are not built   design        derivatives by alpha and by values of laws
    statics       entries for what is at rest     responses     numbers of a state
                                                  steps         what every method of integration has
                                                  dynamics      forces, equations of motion, joints
                                                  model         a scene as arrays
"""
