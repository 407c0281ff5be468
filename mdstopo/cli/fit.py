"""`mdstopo fit`: numbers of a case from measurements."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdstopo.cli.interrupt import Interrupts
from mdstopo.cli.options import EXIT, FILE, announce_compilation, case_argument, open_case, output_options, set_option
from mdstopo.cli.output import Output, number

if TYPE_CHECKING:
    from mdstopo.case.model import Case
    from mdstopo.fit.problem import FitProblem
    from mdstopo.fit.run_fit import FitRun

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
@click.option("--out", type=FILE, metavar="FILE", help="Where the result goes, JSON (default: results/CASE.fit.json).")
@click.option("--plot", "picture_path", type=FILE, metavar="FILE", help="Draw fit and residuals: .png, .svg, .pdf.")
@click.option("--resume", is_flag=True, help="Go on with a fit that was stopped.")
@click.option("--overwrite", is_flag=True, help="Replace the result and the fitted case that are there.")
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
    numbers is written beside it, as NAME.fitted.yaml.
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
        from mdstopo.case.errors import CaseError

        needed = "the key 'fit' is missing: it says what is estimated and what was measured"
        raise CaseError([case.marks.mistake("", needed)], str(case_path))
    from mdstopo.fit.record import content, write
    from mdstopo.store.atomic import replace_file

    path = out or Path("results") / f"{case.name}.fit.json"
    fitted_path = path.with_name(f"{case.name}.fitted.yaml")
    before = _places(path, fitted_path, picture_path, case, resume, overwrite)
    interrupts = Interrupts(quiet)
    from mdstopo.fit.fitted_case import fitted_text
    from mdstopo.fit.prepared import prepared
    from mdstopo.fit.problem import FitProblem
    from mdstopo.fit.run_fit import run_fit

    announce_compilation(output, prepared(case))
    problem = FitProblem(case)
    known = _before(problem, before, path)
    run = run_fit(problem, points, known, lambda each: write(each, path), interrupts.stop_requested)
    written = None
    if run.found is not None:
        count = len(problem.numbers.keys)
        numbers = dict(zip(problem.names[:count], run.found.x[:count].tolist(), strict=True))
        replace_file(fitted_path, fitted_text(case, numbers, fitted_path).encode())
        written = fitted_path
        if picture_path is not None:
            from mdstopo.plots.fit_picture import picture

            picture(content(run), picture_path)
    _say(output, run, path, written)
    output.document({"command": "fit", **content(run), "path": str(path), "fitted_case": written and str(written)})
    for remark in _remarks(run):
        output.notice(f"warning: {remark}")
    if run.status == "interrupted":
        output.notice("interrupted; to go on, add --resume to the command")
    return EXIT[run.status]


def _places(
    path: Path, fitted_path: Path, picture_path: Path | None, case: "Case", resume: bool, overwrite: bool
) -> dict[str, Any] | None:
    """What the result file holds that is gone on with, or None; refuses to replace what it was not told to.

    path, fitted_path, picture_path: what is going to be written.
    case: which is not replaced whatever is said.
    resume, overwrite: as of the command.
    """
    from mdstopo.fit.record import read
    from mdstopo.plots.style import FORMATS
    from mdstopo.store.store_errors import StoreError

    if resume and overwrite:
        raise click.UsageError("say --resume or --overwrite, not both")
    if picture_path is not None and picture_path.suffix.lower() not in FORMATS:
        raise StoreError(f"{picture_path}: a picture ends in {', '.join(FORMATS)}")
    if resume and not path.exists():
        raise StoreError(f"{path}: there is no result to go on with")
    for place in (path, fitted_path):
        if case.path is not None and place.exists() and case.path.exists() and place.samefile(case.path):
            raise StoreError(f"{place}: this is the case that is fitted; choose another place with --out")
        if place.exists() and not (resume or (overwrite and place.is_file())):
            raise StoreError(f"{place} exists already; it is left as it is (--overwrite, --resume)")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error
    return read(path) if resume else None


def _before(problem: "FitProblem", before: dict[str, Any] | None, path: Path) -> "FitRun | None":
    """The run that is gone on with; refuses that of another case or of other measurements."""
    from mdstopo.fit.record import asked
    from mdstopo.fit.run_fit import restored
    from mdstopo.store.store_errors import StoreError

    if before is None:
        return None
    if before["asked"] != asked(problem):
        raise StoreError(
            f"{path}: the case, what is fitted, or what was measured is not the same; --overwrite begins anew"
        )
    return restored(problem, before)


def _say(output: Output, run: "FitRun", path: Path, written: Path | None) -> None:
    problem = run.problem
    output.say(f"{problem.case.title or problem.case.name}: {run.status.replace('_', ' ')} - {run.reason}")
    if run.found is not None and run.statistics is not None:
        share = f"{100.0 * problem.fit.confidence:g} %"
        profiled = bool(run.profiles)
        rows = [["estimate", "value", "deviation", f"{share} from", "to", *(["by profile from", "to"] * profiled),
                 "derivative"]]  # fmt: skip
        for i, name in enumerate(problem.names):
            bound = int(run.statistics.at_bound[i])
            ends = (run.statistics.deviation[i], run.statistics.low[i], run.statistics.high[i])
            cells = ["-" if math.isnan(each) else number(each) for each in ends]
            if bound:
                cells[0] = f"at {'upper' if bound > 0 else 'lower'}"
            if profiled:
                own = run.profiles.get(name)
                pair = (math.nan, math.nan) if own is None else (own.low, own.high)
                cells += ["-" if math.isnan(each) else number(each) for each in pair]
            rows.append([name, number(run.found.x[i], 7), *cells, problem.derivatives[i]])
        output.table(rows)
        _say_apart(output, run)
        _say_series(output, run)
    rows = [["simulations", str(run.simulations)]]
    if problem.fit.starts > 1 and run.starts:
        rows.append(["starts", f"{len(run.starts)}, {run.agreeing} of them at the same minimum"])
    rows.append(["result", str(path)])
    if written is not None:
        rows.append(["fitted case", str(written)])
    output.table(rows)


def _say_apart(output: Output, run: "FitRun") -> None:
    """What the data cannot tell apart, and what varies together."""
    assert run.statistics is not None
    for each in run.statistics.directions:
        parts = " ".join(f"{share:+.2g} {name}" for name, share in each.shares.items())
        how = "not at all" if each.is_unknown else f"hardly: {number(each.change, 2)} deviations from bound to bound"
        output.say(f"the data tell {how}: {parts} (shares of the way between bounds)")
    names = run.problem.names
    for i in range(len(names)):
        for j in range(i):
            both = float(run.statistics.correlation[i, j])
            if abs(both) > 0.95:
                output.say(f"{names[j]} and {names[i]} vary together: correlation {number(both, 4)}")


def _say_series(output: Output, run: "FitRun") -> None:
    assert run.found is not None
    rows = [["series", "values", "root mean square left", "unit", "deviation", "squares / values"]]
    from mdstopo.case.units import unit_of

    for each, part in zip(run.problem.measured, run.problem.parts, strict=True):
        misfit, deviation = run.found.misfit[part], run.found.deviation[part]
        low, high = float(deviation.min()), float(deviation.max())
        told = number(low, 4) if low == high else f"{number(low, 4)} to {number(high, 4)}"
        squares = "" if each.deviation is None else number(float(((misfit / deviation) ** 2).mean()), 3)
        rows.append(
            [each.series.name, str(len(each.t)), number(float((misfit**2).mean()) ** 0.5, 4),
             unit_of(each.series.response), told if each.deviation is not None else f"{told} (estimated)",
             squares]
        )  # fmt: skip
    output.table(rows)


def _remarks(run: "FitRun") -> list[str]:
    """What the user should know of a fit."""
    if run.statistics is None:
        return []
    told = []
    from mdstopo.fit.solve import stated_deviations

    known = not math.isnan(float(stated_deviations(run.problem).max()))
    if known and run.problem.fit.loss == "linear" and run.statistics.freedom > 0:
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
