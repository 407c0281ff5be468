"""What a response takes of a vector that changes with time: codes that kernels of both kinds of bodies share."""

#: a component, the norm, or, of vectors in a plane, ACROSS: the component perpendicular to the vector as it is, whose
#: own value is 0
X, Y, NORM, ACROSS, Z = range(5)
#: how many derivatives by time
DISPLACEMENT, VELOCITY, ACCELERATION = range(3)
