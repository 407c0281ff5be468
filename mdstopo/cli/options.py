"""Arguments and options that several commands share."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from mdstopo.cli.files import CaseFile, FileOf
from mdstopo.cli.output import Output

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from mdstopo.case.model import Case
    from mdstopo.engine import Evaluator

F = TypeVar("F", bound=Callable[..., Any])

FILE = click.Path(path_type=Path)
#: exit statuses of what runs, by how it ended
EXIT = {"converged": 0, "max_iterations": 0, "stalled": 0, "failed": 1, "interrupted": 3}
CASE_FILE = CaseFile((".yaml", ".yml"))
RESULT_FILE = FileOf((".h5",))
DESIGN_FILE = FileOf((".npy", ".txt", ".h5"))


def case_argument(function: F) -> F:
    """Add the argument CASE, a YAML file, to a command."""
    return click.argument("case_path", metavar="CASE", type=CASE_FILE)(function)


def result_argument(function: F) -> F:
    """Add the argument RESULT, an HDF5 file, to a command."""
    return click.argument("result_path", metavar="RESULT", type=RESULT_FILE)(function)


def set_option(function: F) -> F:
    """Add the option `--set KEY=VALUE` to a command."""
    return click.option(
        "--set",
        "overrides",
        metavar="KEY=VALUE",
        multiple=True,
        callback=_pairs,
        help="Override a key of the case, e.g. solver.tolerance=1e-10; may be repeated.",
    )(function)


def out_option(function: F) -> F:
    """Add the option `--out FILE` to a command."""
    return click.option("--out", type=FILE, metavar="FILE", help="Where to write the result.")(function)


def overwrite_option(function: F) -> F:
    """Add the option `--overwrite` to a command."""
    return click.option("--overwrite", is_flag=True, help="Replace whatever the result file holds.")(function)


def alpha_option(function: F) -> F:
    """Add the option `--alpha FILE` to a command."""
    return click.option(
        "--alpha",
        "alpha_path",
        type=DESIGN_FILE,
        metavar="FILE",
        help="Take the design from a .npy, .txt or result file; FRONT.h5:K is point K.",
    )(function)


def output_options(function: F) -> F:
    """Add the options `--json` and `--quiet` to a command."""
    function = click.option("--quiet", "-q", is_flag=True, help="Say nothing but mistakes.")(function)
    return click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of text.")(function)


def _pairs(_context: click.Context, _parameter: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
    pairs = {}
    for text in values:
        key, sign, value = text.partition("=")
        if not sign or not key.strip():
            raise click.BadParameter(f"{text!r} is not KEY=VALUE")
        pairs[key.strip()] = value
    return pairs


def open_case(path: Path, overrides: dict[str, str], alpha_path: Path | None = None) -> "Case":
    """Read a case and refuse what the engine cannot compute. Raises CaseError with every mistake.

    alpha_path: of a design; where that is a result and candidates are priced, they are members that are there.
    """
    from mdstopo.case.reader import load_case
    from mdstopo.case.text.errors import CaseError
    from mdstopo.scene.refusals import refusals

    case = load_case(path, overrides)
    refused = refusals(case)
    if refused:
        raise CaseError(refused, str(path))
    if case.priced_groups and alpha_path is not None:
        from mdstopo.store.design_files import place_of
        from mdstopo.store.result_reader import read_result
        from mdstopo.store.stored_case import built_case

        file, _ = place_of(str(alpha_path))
        if file.suffix.lower() in (".h5", ".hdf5"):
            return built_case(read_result(file, leave_out=("optimizer", "trajectories")), case)
    return case


def open_design(path: Path | None, case: "Case") -> "NDArray[np.float64]":
    """The design of --alpha, else the case's own: alpha, then the values of variables.

    Raises StoreError for a file that holds none.
    """
    if path is None:
        return case.start
    from mdstopo.store.design_files import read_design

    return case.whole(read_design(path, case.n_design, case.space.parts))


def check_design(engine: "Evaluator", alpha: "NDArray[np.float64]", path: Path | None) -> None:
    """Refuse a design that the engine cannot take. Raises StoreError."""
    from mdstopo.store.store_errors import StoreError

    try:
        engine.design(alpha)
    except ValueError as error:
        raise StoreError(f"{path or 'the initial design'}: {error}") from error


def result_path(out: Path | None, case: "Case", kind: str = "") -> Path:
    """The path of the result: `--out`, or else results/<case>[.<kind>].h5."""
    if out is not None:
        return out
    return Path("results") / (f"{case.name}.{kind}.h5" if kind else f"{case.name}.h5")


def announce_compilation(output: Output, case: "Case", methods: Sequence[str] = ()) -> None:
    """Say that the first run takes longer, before it does. methods: of differentiation, beside the case's own."""
    from mdstopo.warm import compilation_due, compiling

    if compilation_due(case, methods):
        output.announce(compiling(case, methods))
