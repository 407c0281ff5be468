"""Scenes in full generality: joints, prescribed motions, every member law, every response.

The scenes of springs between free bodies, looked at by their stored energy, have kernels of their own (`mechanics`,
`integrators`, `sensitivity`), which know nothing of what is here. This package computes everything else, and the same
scenes too, by its own formulas, so that the two families check each other.

    model        a scene as arrays          members      all laws, summed over members at one pose
    forces       all that acts              balance      accelerations and multipliers from forces
    stages       one evaluated state        projection   back onto the joints
    events       members that switch        runge_kutta, generalized_alpha   steps through time
    responses    what is looked at          extremes     over time
    adjoint, direct                         look         what Python calls
"""
