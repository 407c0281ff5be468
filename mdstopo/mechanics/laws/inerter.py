"""`inerter`: f = b d2Delta/dt2. Parameters: b. Its force needs accelerations: it is part of the mass."""

from mdstopo.mechanics.laws.law_kernels import LawKernels

KERNELS = LawKernels(inertial=True)
