"""`mdstopo fit`: numbers of a case from measurements."""

import math
import shlex
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from mdstopo.cli.fit_numbers import say_fit
from mdstopo.cli.interrupt import Interrupts, saying_how_to_go_on
from mdstopo.cli.options import (
    EXIT,
    FILE,
    announce_compilation,
    case_argument,
    open_case,
    out_option,
    output_options,
    result_path,
    set_option,
)
from mdstopo.cli.output import Output, number
from mdstopo.cli.pareto import resumed

if TYPE_CHECKING:
    from collections.abc import Callable

    from mdstopo.case.model import Case
    from mdstopo.fit.fit_problem import FitProblem
    from mdstopo.fit.run_fit import FitRun
    from mdstopo.store.result_reader import ResultView

#: a fit whose squares sum up to less or more than happens by chance once in so many times is remarked upon
_RARE = 1e-3


@click.command("fit")
@case_argument
@click.option(
    "--profile",
    "points",
    type=click.IntRange(0),
    default=0,
    metavar="K",
    help="Profiles of all estimates, with K points on each side.",
)
@out_option
@click.option("--plot", "picture_path", type=FILE, metavar="FILE", help="Draw fit and residuals: .png, .svg, .pdf.")
@click.option("--resume", is_flag=True, help="Go on with a fit that was stopped.")
@click.option("--overwrite", is_flag=True, help="Replace whatever the result file and the fitted case hold.")
@set_option
@output_options
def command(
    case_path: Path,
    points: int,
    out: Path | None,
    picture_path: Path | None,
    resume: bool,
    overwrite: bool,
    overrides: dict[str, str],
    as_json: bool,
    quiet: bool,
) -> int:
    """Estimate numbers of a case from what was measured, as its section `fit` says.

    The result tells estimates with their intervals, and what the data cannot tell apart. The case with the fitted
    numbers is written beside it, as NAME.fitted.yaml. `mdstopo show`, `plot`, `report` and `watch` take the result.
    \f
    Arguments, which --help leaves out:

    case_path: the case file.
    points: of profiles on each side; 0: none.
    out: the result file; None takes a name after the case's.
    picture_path: where the picture goes; None: nowhere.
    resume: whether a fit that was stopped goes on.
    overwrite: whether files that are there are replaced.
    overrides: values of the case's keys.
    as_json, quiet: print one JSON object; say nothing but mistakes.
    """  # fmt: skip
    output = Output(json=as_json, quiet=quiet)
    case = open_case(case_path, overrides)
    if case.fit is None:
        from mdstopo.case.text.errors import CaseError

        needed = "the key 'fit' is missing: it says what is estimated and what was measured"
        raise CaseError([case.marks.mistake("", needed)], str(case_path))
    from mdstopo.fit.fit_record import content
    from mdstopo.store.admit import prepare_place
    from mdstopo.store.atomic import remove_leftovers
    from mdstopo.store.lock import Lock
    from mdstopo.store.result_reader import read_result

    line = shlex.join(["mdstopo", *sys.argv[1:]])
    path, again = result_path(out, case, "fit"), resumed(line)
    _check(picture_path, resume, overwrite)
    interrupts = Interrupts(quiet)
    with saying_how_to_go_on(output, "fit", case.name, path, resume, again):
        place = prepare_place(path)
        with Lock(place):
            remove_leftovers(place)
            run = _fitted(case, place, _Asked(points, resume, overwrite, line), output, interrupts.stop_requested)
    found = content(read_result(path))
    written = _fitted_place(path) if run.minimum is not None else None
    if written is not None and picture_path is not None:
        _draw(path, picture_path)
    output.say(f"{case.title or case.name}: {run.status.replace('_', ' ')} - {run.reason}")
    say_fit(output, found)
    output.table([["result", str(path)], *([["fitted case", str(written)]] if written else [])])
    output.document({"command": "fit", **found, "path": str(path), "fitted_case": written and str(written)})
    for remark in _remarks(run):
        output.notice(f"warning: {remark}")
    if run.status == "interrupted":
        output.notice(f"interrupted; to go on: {again}")
    return EXIT[run.status]


def _check(picture_path: Path | None, resume: bool, overwrite: bool) -> None:
    """Refuse options that exclude each other, and a picture that cannot be. Raises UsageError, StoreError."""
    from mdstopo.plots.style import FORMATS
    from mdstopo.store.store_errors import StoreError

    if resume and overwrite:
        raise click.UsageError("--resume and --overwrite exclude each other")
    if picture_path is not None and picture_path.suffix.lower() not in FORMATS:
        raise StoreError(f"{picture_path}: a picture ends in {', '.join(FORMATS)}")


class _Asked(NamedTuple):
    """points: of profiles; resume, overwrite: what becomes of a result that is there; line: the command line."""

    points: int
    resume: bool
    overwrite: bool
    line: str


def _fitted(
    case: "Case",
    place: Path,
    asked: _Asked,
    output: Output,
    stop: "Callable[[], bool]",
) -> "FitRun":
    """The fit, which is kept at a place that is locked, and the fitted case beside it.

    case: with its section `fit`.
    place: of the result file.
    asked: how it is to be done.
    output: where it is said what happens.
    stop: whether to end.
    """
    from mdstopo.fit.fit_problem import FitProblem
    from mdstopo.fit.fit_record import FitFile
    from mdstopo.fit.fitted_case import fitted_text
    from mdstopo.fit.prepared import prepared
    from mdstopo.fit.run_fit import FitRun, run_fit
    from mdstopo.store.atomic import replace_file
    from mdstopo.store.checkpoint import Checkpointer

    before = _before(case, place, asked.resume, asked.overwrite, output.notice)
    fitted_place = _fitted_place(place)
    _check_fitted(fitted_place, place, case, asked.overwrite)
    announce_compilation(output, prepared(case))
    problem = FitProblem(case)
    known = None if before is None else _restored(problem, before)
    fitted_before = fitted_place.read_bytes().decode(errors="replace") if fitted_place.exists() else None
    file = FitFile(place, problem, asked.line, fitted_before)
    run = FitRun(problem) if known is None else known
    saver = Checkpointer(lambda: file.checkpoint(run), notify=output.notice)

    def save(_run: FitRun, urgent: bool = True) -> None:
        saver.offer(urgent=urgent)

    run_fit(problem, asked.points, run, save, stop, partial(save, urgent=False))
    text = None
    if run.minimum is not None:
        count = len(problem.numbers.keys)
        numbers = dict(zip(problem.names[:count], run.minimum.x[:count].tolist(), strict=True))
        text = fitted_text(case, numbers, fitted_place)
    file.conclude(run, text, tuple(_remarks(run)))
    if text is not None:
        replace_file(fitted_place, text.encode())
    return run


def _before(
    case: "Case", place: Path, resume: bool, overwrite: bool, notify: "Callable[[str], None]"
) -> "ResultView | None":
    """The result that is gone on with, None where it begins anew; refuses to replace what should not be lost.

    case: which is fitted.
    place: of the result file.
    resume, overwrite: as of the command.
    notify: is given sentences for the user.
    """
    from mdstopo.store.admit import admit, admit_resume

    if resume:
        return admit_resume(place, case, notify, "fit")
    admit(place, case, "fit", overwrite, notify)
    return None


def _fitted_place(place: Path) -> Path:
    """Where the fitted case is, beside the result file: `pull.fitted.yaml` of `pull.fit.h5` or `pull.h5`."""
    return place.with_name(f"{place.stem.removesuffix('.fit')}.fitted.yaml")


def _check_fitted(fitted_place: Path, place: Path, case: "Case", overwrite: bool) -> None:
    """Refuse to replace a fitted case that is not as the fit in the result file has written it. Raises StoreError.

    fitted_place: where it is going to be. place: of the result file. case: which is fitted. overwrite: as of the
    command.
    """
    from mdstopo.store.result_reader import read_result
    from mdstopo.store.store_errors import StoreError

    if not fitted_place.exists():
        return
    if case.path is not None and case.path.exists() and fitted_place.samefile(case.path):
        raise StoreError(f"{fitted_place}: this is the case that is fitted; choose another place with --out")
    if overwrite and fitted_place.is_file():
        return
    own = read_result(place, leave_out=("trajectories", "members")).texts if place.exists() else {}
    written = own.get("fit/fitted_case")
    if not fitted_place.is_file() or not isinstance(written, str) or fitted_place.read_bytes() != written.encode():
        raise StoreError(
            f"{fitted_place} is not as the fit in {place.name} has written it; --overwrite replaces it, --out chooses "
            "another place"
        )


def _restored(problem: "FitProblem", before: "ResultView") -> "FitRun":
    """The run that is gone on with; refuses that of another case or of other measurements."""
    from mdstopo.fit.fit_record import asked, content
    from mdstopo.fit.run_fit import restored
    from mdstopo.store.store_errors import StoreError

    if before.texts.get("fit/asked") != asked(problem):
        raise StoreError(
            f"{before.path}: what is fitted, or what was measured, is not the same; --overwrite begins anew"
        )
    return restored(problem, content(before))


def _draw(path: Path, picture_path: Path) -> None:
    """The picture of a result."""
    from mdstopo.plots.fit_plot import draw
    from mdstopo.plots.source import Source
    from mdstopo.plots.style import save, styled

    with styled() as module:
        save(draw(module, Source(path)), picture_path)


def _remarks(run: "FitRun") -> list[str]:
    """What the user should know of a fit."""
    if run.statistics is None:
        return []
    told = []
    from mdstopo.case.methods.losses import LOSSES
    from mdstopo.fit.least_squares import stated_deviations

    known = not math.isnan(float(stated_deviations(run.problem).max()))
    if known and not LOSSES[run.problem.fit.loss].is_robust and run.statistics.freedom > 0:
        from scipy.stats import chi2

        squares, freedom = run.statistics.chi_square, run.statistics.freedom
        if chi2.sf(squares, freedom) < _RARE:
            told.append(
                f"squares sum up to {number(squares, 4)}, {freedom} are expected: the model misses something, or the "
                "stated deviations are too small; intervals are too narrow then"
            )
        elif chi2.cdf(squares, freedom) < _RARE:
            told.append(
                f"squares sum up to {number(squares, 4)}, {freedom} are expected: the stated deviations are too large"
            )
    bounds = [name for name, bound in zip(run.problem.names, run.statistics.at_bound, strict=True) if bound]
    if bounds:
        told.append(f"at a bound: {', '.join(bounds)}; intervals of the others hold with these where they are")
    differenced = [n for n, how in zip(run.problem.names, run.problem.derivatives, strict=True) if how != "exact"]
    if differenced:
        told.append(f"differentiated by differences of tighter motions: {', '.join(differenced)}")
    return told
