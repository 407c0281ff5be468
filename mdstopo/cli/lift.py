"""`mdstopo lift`: the case in space of a planar one."""

import math
from pathlib import Path

import click

from mdstopo.cli.options import FILE, case_argument, set_option
from mdstopo.cli.output import Output


@click.command("lift")
@case_argument
@click.option("--out", type=FILE, metavar="FILE", help="Write it to a file (default: print it).")
@click.option("--overwrite", is_flag=True, help="Replace the file that is there.")
@click.option(
    "--tilt",
    type=(float, float, float, float),
    metavar="X Y Z ANGLE",
    default=(0.0, 0.0, 1.0, 0.0),
    help="Turn the plane z = 0 about an axis through the origin by an angle in rad.",
)
@set_option
@click.option("--quiet", "-q", is_flag=True, help="Say nothing but mistakes.")
def command(
    case_path: Path,
    out: Path | None,
    overwrite: bool,
    tilt: tuple[float, float, float, float],
    overrides: dict[str, str],
    quiet: bool,
) -> int:
    """Write the case in space of a planar one, which has the same motion.

    The scene lies in the plane z = 0, or with --tilt in any other. Bodies have their moment of inertia about all axes,
    pins turn about the normal. An angle becomes the component z of the rotation, which is the planar angle up to half a
    turn; seen from ground in a tilted plane it becomes the norm, and only `over_time: max_abs` or `rms` of it can be
    told. Uncertain numbers that are no single ones in space, and what the solver cannot do there yet, are
    refused by name.
    \f
    Arguments, which --help leaves out:

    case_path: the planar case.
    out: where the case in space is written; None prints it.
    overwrite: whether a file that is there is replaced.
    tilt: axis and angle (rad) of the turn from z = 0 to the plane of the scene.
    overrides: values of the case's keys.
    quiet: say nothing but mistakes.
    """
    *axis, angle = tilt
    if not all(math.isfinite(value) for value in tilt) or not any(axis):
        raise click.BadParameter("an axis of three finite numbers, not all zero, and an angle", param_hint="--tilt")
    from mdstopo.case.reader import load_case
    from mdstopo.finalize.lift_case import lifted
    from mdstopo.store.atomic import replace_file
    from mdstopo.store.store_errors import StoreError

    if out is not None and out.exists() and not (overwrite and out.is_file()):
        raise StoreError(f"{out} exists already; it is left as it is")
    case = load_case(case_path, overrides)
    if out is not None and out.exists() and case_path.samefile(out):
        raise StoreError(f"{out}: this is what the new case is made from; choose another place with --out")
    text = lifted(case, (axis[0], axis[1], axis[2]), angle)
    output = Output(json=False, quiet=quiet)
    if out is None:
        output.say(text.rstrip("\n"))
        return 0
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"{out}: cannot be written: {error.strerror}") from error
    replace_file(out, text.encode())
    output.say(f"{out}\n  mdstopo check {out}")
    return 0
