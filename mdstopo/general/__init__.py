"""Scenes in full generality: joints, prescribed motions, every member law, every response.

Scenes of springs between free bodies whose responses are stored energies have kernels of their own (`mechanics`,
`integrators`, `sensitivity`), which know nothing of what is here. This package computes everything else, and the same
scenes too, by its own formulas, so that the two families check each other.

Its folders, from what Python calls down to the arrays; imports point downwards (`.importlinter`):

    driver        evaluates a compiled scene      sensitivity   adjoint, direct, iterative, constant load
    scene         from a case to arrays           integrators   steps through time, and these linearised
    pricing       candidates that are not built   events        members that switch
    statics       before a run begins             design        derivatives by alpha and by values of laws
    structures    their types, by name            responses     numbers of a state
    peaks         responses between steps         steps         what every method of integration has
                                                  dynamics      forces, equations of motion, joints
                                                  model         a scene as arrays
"""
