"""A case as a PyTorch function with its exact gradient: `pip install 'mdstopo[torch]'`.

    values = mdstopo.torch.function(case)
    x = torch.tensor(case.start, requires_grad=True)
    values(x)[0].backward()

What `values` gives are objectives, then excesses of constraints, as `mdstopo.functions.Responses` has them. The design
is computed by mdstopo on the processor in double precision; values have the type and the device of x. Derivatives of
the gradient do not exist, and PyTorch says so.
"""

from collections.abc import Callable
from typing import Any

from mdstopo.case.model import Case
from mdstopo.functions import Responses, extra

with extra("torch", "PyTorch"):
    import torch
    from torch.autograd.function import once_differentiable


def function(case: Case, method: str = "auto") -> Callable[[Any], Any]:
    """x (n,) -> (m,): values of a case's objectives and constraints; method: of differentiation."""
    responses = Responses(case, method)

    class Values(torch.autograd.Function):  # type: ignore[misc, unused-ignore]
        """The values, and what pulls cotangents of them back to x."""

        @staticmethod
        def forward(context: Any, x: Any) -> Any:
            """Values (m,) at x (n,)."""
            values, slopes = responses.at(x.detach().cpu().numpy())
            context.save_for_backward(torch.as_tensor(slopes, dtype=x.dtype, device=x.device))
            return torch.as_tensor(values, dtype=x.dtype, device=x.device)

        @staticmethod
        @once_differentiable  # type: ignore[untyped-decorator, misc, unused-ignore]
        def backward(context: Any, cotangent: Any) -> Any:
            """The cotangent (m,) of the values as one of x (n,)."""
            (slopes,) = context.saved_tensors
            return cotangent @ slopes

    chosen: Callable[[Any], Any] = Values.apply
    return chosen
