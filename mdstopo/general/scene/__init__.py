"""From a case to the arrays of a scene, in a plane and in space."""
