"""Scenes in full generality: joints, prescribed motions, every member law, every response.

Scenes of springs between free bodies whose responses are stored energies have kernels of their own (`mechanics`,
`integrators`, `sensitivity`), which know nothing of what is here. This package computes everything else, and the same
scenes too, by its own formulas, so that the two families check each other.

    general_model    a scene as arrays      members            all laws, summed over members at one pose
    forces           all that acts          accelerations      with multipliers, from forces
    projection       back onto the joints   events             members that switch
    adaptive_steps, generalized_alpha, gauss                   steps through time
    step_history     what they leave        general_responses  numbers of a state
    adjoint, direct  their derivatives      general_driver     what Python calls
"""
