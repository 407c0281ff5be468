"""The coefficients of Dormand and Prince's method of order 8, from SciPy's file of them."""

from benchmarks.peers.problem import Floats


def order_eight() -> tuple[Floats, Floats]:
    """A (12, 12) and b (12,) (Hairer, Norsett, Wanner: Solving Ordinary Differential Equations I, DOP853)."""
    from scipy.integrate._ivp import dop853_coefficients

    return dop853_coefficients.A[:12, :12], dop853_coefficients.B
