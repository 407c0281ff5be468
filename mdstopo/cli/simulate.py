"""`mdstopo simulate`: the motion of one design."""

import shlex
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdstopo.cli.long_motion import told_while
from mdstopo.cli.options import (
    alpha_option,
    announce_compilation,
    case_argument,
    check_design,
    open_case,
    open_design,
    out_option,
    output_options,
    overwrite_option,
    result_path,
    set_option,
)
from mdstopo.cli.output import Output, duration, number
from mdstopo.cli.values_of_motion import Values, document_of, rows_of, values_of
from mdstopo.shown import counted

if TYPE_CHECKING:
    from mdstopo.case.model import Case, FloatArray
    from mdstopo.engine import Evaluator
    from mdstopo.evaluation import MotionValues
    from mdstopo.integrators.trajectory import Trajectory
    from mdstopo.scene.settled import Settled
    from mdstopo.store.contents import Motion


@click.command("simulate")
@case_argument
@alpha_option
@click.option(
    "--load-case", "names", multiple=True, metavar="NAME", help="Simulate this load case alone; may be repeated."
)
@out_option
@overwrite_option
@set_option
@output_options
def command(
    case_path: Path,
    alpha_path: Path | None,
    names: tuple[str, ...],
    out: Path | None,
    overwrite: bool,
    overrides: dict[str, str],
    as_json: bool,
    quiet: bool,
) -> int:
    """Compute the motion of one design in every load case and write it to a file.

    Objectives and constraints of these load cases are printed, too; of an uncertain case the nominal ones.
    \f
    Arguments, which --help leaves out:

    case_path: the case file.
    alpha_path: the file of the design; None takes the case's.
    names: of the load cases; none takes all.
    out: the result file; None takes a name after the case's.
    overwrite: whether what the file holds is replaced.
    overrides: values of the case's keys.
    as_json, quiet: print one JSON object; say nothing but mistakes.
    """
    output = Output(json=as_json, quiet=quiet)
    case = open_case(case_path, overrides, alpha_path)
    alpha = open_design(alpha_path, case)
    chosen = _load_cases(case, names)
    path = result_path(out, case, "simulate")
    command_line = shlex.join(["mdstopo", *sys.argv[1:]])
    from mdstopo.store.output_file import output_file

    with output_file(path, case, "simulate", overwrite=overwrite, notify=output.notice, command=command_line) as file:
        announce_compilation(output, case)
        from mdstopo.engine import Evaluator
        from mdstopo.status import RunStatus, Status
        from mdstopo.store.contents import design_part, trajectory_part

        began = time.perf_counter()
        engine = Evaluator(case)
        check_design(engine, alpha, alpha_path)
        ready = time.perf_counter()
        motions, evaluated = _motions(output, case, engine, alpha, chosen)
        ended = time.perf_counter()
        rests = {name: engine.settled(alpha, name) for name in chosen}
        failed = [motion for motion in motions.values() if motion.status is not Status.OK]
        values = Values({}, {}) if failed else values_of(case, engine.design(alpha), evaluated)
        status = RunStatus.FAILED if failed else RunStatus.CONVERGED
        reason = f"{failed[0].status.value}: {failed[0].message}" if failed else "done"
        file.write(
            status.value,
            reason,
            design_part(case, alpha) | trajectory_part(motions),
            {"integrator": engine.integrator, "integrator_reason": engine.integrator_reason},
        )
    output.say(f"{case.title or case.name}: {reason}")
    for name, motion in motions.items():
        _say_motion(output, case, name, motion, rests[name])
    output.table(
        [
            *rows_of(case, values),
            ["integrator", f"{engine.integrator}: {engine.integrator_reason}"],
            ["time", f"{duration(ended - ready)}, {duration(ready - began)} to get ready"],
            ["result", str(path)],
        ]
    )
    output.document(
        {
            "command": "simulate",
            "case": case.name,
            "status": status.value,
            "reason": reason,
            "load_cases": {name: _motion_document(case, motion, rests[name]) for name, motion in motions.items()},
            **document_of(case, values),
            "integrator": engine.integrator,
            "seconds": ended - ready,
            "compile_seconds": ready - began,
            "path": str(path),
        }
    )
    _warn(output, case, engine, motions)
    return 1 if failed else 0


def _load_cases(case: "Case", names: tuple[str, ...]) -> list[str]:
    known = [load_case.name for load_case in case.load_cases]
    for name in names:
        if name not in known:
            raise click.BadParameter(f"no load case {name!r}; there are {', '.join(known)}", param_hint="--load-case")
    return list(names) or known


def _motions(
    output: Output, case: "Case", engine: "Evaluator", alpha: "FloatArray", names: list[str]
) -> "tuple[dict[str, Trajectory], list[MotionValues]]":
    """The motion of each of these load cases, and what objectives and constraints of it come to; one that takes long
    says how far it is."""
    motions, evaluated = {}, []
    for name in names:
        with told_while(output.notice, case, engine, alpha, name):
            motions[name], values = engine.trajectory_with_values(alpha, name)
        evaluated.append(values)
    return motions, evaluated


def _warn(output: Output, case: "Case", engine: "Evaluator", motions: "dict[str, Trajectory]") -> None:
    """Tell of steps that are coarse beside vibrations, and of integrals that are nearly zero."""
    from mdstopo.session.coarse_steps import coarse_steps
    from mdstopo.session.near_zero import near_zero

    for warning in (*(coarse_steps(case, *each) for each in motions.items()), near_zero(case, engine)):
        if warning:
            output.notice(f"warning: {warning}")


def _say_motion(output: Output, case: "Case", name: str, motion: "Motion", rest: "Settled | None") -> None:
    output.say(
        f"load case {name}: {counted(len(motion.t) - 1, 'step')} from {number(motion.t[0])} to {number(motion.t[-1])} s"
    )
    rows = [["body", "x, m", "y, m", "angle, rad", "vx, m/s", "vy, m/s", "rate, rad/s"]]
    if case.dimension > 2:
        rows = [["body", *(f"{axis}, m" for axis in "xyz"), *(f"v{axis}, m/s" for axis in "xyz")]]
        rows[0] += [f"rate {axis}, rad/s" for axis in "xyz"]
    for body, (q, v) in _last(case, motion).items():
        place = q[:3]  # in space the attitude stands in the result file
        rows.append([body, *(number(value) for value in (*place, *v))])
    output.table(rows)
    if rest is not None:
        output.say(f"  {rest}")


def _last(case: "Case", motion: "Motion") -> "dict[str, tuple[FloatArray, FloatArray]]":
    """The coordinates and velocities of each body at the end."""
    count = len(case.bodies)
    q, v = motion.q[-1].reshape(count, -1), motion.v[-1].reshape(count, -1)
    return {body.name: (q[i], v[i]) for i, body in enumerate(case.bodies)}


def _motion_document(case: "Case", motion: "Motion", rest: "Settled | None") -> dict[str, Any]:
    settled = {} if rest is None else {"settled": {"moved": rest.moved, "turned": rest.turned}}
    return settled | {
        "steps": len(motion.t) - 1,
        "end": motion.t[-1],
        "bodies": {body: {"q": q, "v": v} for body, (q, v) in _last(case, motion).items()},
    }
