"""What stands where in a result file: the contract's paths, filled from the program's objects.

Each function gives a part of the file as {path: value}; `image.encode` turns their union into bytes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.status import Status
from mdstopo.store.image import Attribute, Value, encode, texts
from mdstopo.store.labels import labels
from mdstopo.store.provenance import Provenance
from mdstopo.store.same_case import describe
from mdstopo.store.set_keys import set_keys

FORMAT = 1

#: where a file keeps what is known of candidates that are priced
CANDIDATES = "candidates"

Floats = NDArray[np.float64]
Datasets = dict[str, Value]


class Motion(Protocol):
    """The steps of a trajectory: t (T,), q, v, a (T, columns of all bodies), lam (T, n_rows), reactions (T, 3 or 6) by
    joint; how it ended."""

    @property
    def t(self) -> Floats: ...
    @property
    def q(self) -> Floats: ...
    @property
    def v(self) -> Floats: ...
    @property
    def a(self) -> Floats: ...
    @property
    def lam(self) -> Floats: ...
    @property
    def reactions(self) -> Mapping[str, Floats]: ...
    @property
    def status(self) -> Status: ...


def case_part(case: Case) -> Datasets:
    """The case as read and its members, in their order."""
    groups = case.members
    counts = [len(group.length) for group in groups]
    pieces: Datasets = {
        "case": case.text,
        "resume/case": describe(case),
        **ends_part(case),
        "members/group": np.repeat(texts([group.name for group in groups]), counts),
        "objectives": [objective.name for objective in case.objectives],
        "members/design": np.repeat(np.array([group.design for group in groups], dtype=np.bool_), counts),
    }
    return pieces | {f"files/{name}": digest for name, digest in case.files.items()}


def ends_part(case: Case) -> Datasets:
    """The ends of all members in their order, global at the start."""
    groups = case.members
    return {
        "members/p": _rows([group.p_world for group in groups], case.dimension),
        "members/q": _rows([group.q_world for group in groups], case.dimension),
    }


def trajectory_part(trajectories: Mapping[str, Motion]) -> Datasets:
    """The motion in each load case, by its name."""
    part: Datasets = {}
    for name, motion in trajectories.items():
        part |= {
            f"trajectories/{name}/t": motion.t,
            f"trajectories/{name}/q": motion.q,
            f"trajectories/{name}/v": motion.v,
            f"trajectories/{name}/a": motion.a,
            f"trajectories/{name}/lambda": motion.lam,
        }
        part |= {f"trajectories/{name}/reactions/{joint}": force for joint, force in motion.reactions.items()}
    return part


def design_part(case: Case, design: Floats, group: str = "design") -> Datasets:
    """Designs (..., N + P): alpha, and the values of each variable."""
    space = case.space
    values = {f"{group}/variables/{name}": each for name, each in space.named(design).items()}
    return {f"{group}/alpha": design[..., : space.n_alpha], **values}


def sensitivity_part(
    gradients: Mapping[str, Floats],
    method: str | None = None,
    by_variable: Mapping[str, Mapping[str, Floats]] | None = None,
) -> Datasets:
    """dG/dalpha (N,) by objective, below its method's name where there are several methods.

    by_variable: the derivatives by the values of variables, by objective and name.
    """
    prefix = "sensitivities" if method is None else f"sensitivities/{method}"
    part: Datasets = {f"{prefix}/{objective}": gradient for objective, gradient in gradients.items()}
    for objective, named in (by_variable or {}).items():
        part |= {f"{prefix}/variables/{objective}/{name}": gradient for name, gradient in named.items()}
    return part


@dataclass(frozen=True, slots=True, kw_only=True)
class Contents:
    """All that one result file holds.

    case: the design problem.
    kind: the command that made it.
    provenance: what made it: versions, command, machine.
    settings: what was chosen and why (integrator, sensitivity method, seed), attributes of the group `settings`.
    datasets: arrays and texts, by their paths in the file.
    status: a word of `RunStatus`.
    reason: a sentence on it.
    warnings: sentences.
    """

    case: Case
    kind: str
    provenance: Provenance
    settings: Mapping[str, Attribute]
    datasets: Datasets
    status: str = "running"
    reason: str = "running"
    warnings: tuple[str, ...] = ()

    @classmethod
    def begun(
        cls, case: Case, kind: str, command: str, datasets: Datasets, settings: Mapping[str, Attribute] | None = None
    ) -> "Contents":
        """What is the same each time a command writes its file.

        command: the command line, for the record. settings: those of the command; what --set changed is added.
        """
        settings = {**(settings or {}), **set_keys(case)}
        return cls(case=case, kind=kind, provenance=Provenance.collect(command), settings=settings, datasets=datasets)

    def now(self, status: str, reason: str, datasets: Datasets, warnings: tuple[str, ...] = ()) -> "Contents":
        """The same file with what is known by now. datasets: those that are added, or replaced."""
        return replace(self, status=status, reason=reason, datasets=self.datasets | datasets, warnings=warnings)


def result_image(contents: Contents) -> bytes:
    """A whole result file, as bytes."""
    case, provenance, status = contents.case, contents.provenance, contents.status
    root: dict[str, Attribute] = {
        "format": FORMAT,
        "mdstopo": provenance.mdstopo,
        "case_sha256": case.sha256,
        "status": status,
        "kind": contents.kind,
        "reason": contents.reason,
        "name": case.name,
        "title": case.title or "",
        "case_path": "" if case.path is None else str(case.path),
    }
    attributes: dict[str, Mapping[str, Attribute]] = {
        "": root,
        "provenance": provenance.attributes(),
        "settings": contents.settings,
    }
    whole = {**contents.datasets, "warnings": list(contents.warnings)}
    if status == "running":  # checkpoints are many, and nobody opens them in a notebook
        return encode(attributes, whole)
    marked = labels(case, whole)
    attributes |= {path: {"units": unit} for path, unit in marked.units.items()}
    return encode(attributes, {**whole, **marked.extra}, marked.scales)


def _rows(blocks: list[Floats], width: int) -> Floats:
    return np.concatenate(blocks) if blocks else np.zeros((0, width))
