"""What commands say of uncertain cases."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from mdstopo.cli.output import Output, number

if TYPE_CHECKING:
    from mdstopo.case.model import Case
    from mdstopo.robust.conclusion import Conclusion
    from mdstopo.store.result_reader import ResultView


def lines_of(conclusion: "Conclusion | None", name: str) -> list[list[str]]:
    """Lines on the sample's results for an objective, or for `constraints[i]`; none in a certain case."""
    found = None if conclusion is None else conclusion.of(name)
    if conclusion is None or found is None:
        return []
    rows = [["  measure", found.measure], ["  nominal", number(found.nominal, 9)]]
    if found.check is not None:
        verdict = "holds it" if found.agrees else "does not hold it"
        interval = f"{number(found.check.low)} to {number(found.check.high)}"
        words = f"{number(found.check.value, 9)}; its 95 % interval {interval} {verdict}; {conclusion.points} points"
        rows.append(["  fresh sample", words])
    if found.worse is not None:
        kept = "" if found.kept is None else f"; {found.kept:.1%} keep the bound"
        rows.append(["  worse there", f"{found.worse:.1%} of the points{kept}"])
    return rows


def document_of(conclusion: "Conclusion | None") -> dict[str, Any] | None:
    """The results of an uncertain case as values for JSON, by objective and constraint."""
    if conclusion is None:
        return None
    return {
        each.name: {
            "measure": each.measure,
            "nominal": each.nominal,
            "value": each.value,
            "validation": None if each.check is None else each.check.value,
            "interval": None if each.check is None else [each.check.low, each.check.high],
            "agrees": each.agrees,
            "worse": each.worse,
            "kept": each.kept,
        }
        for each in conclusion.results
    }


def say_result(output: Output, view: "ResultView") -> None:
    """Print what a result file holds of an uncertain case."""
    if "uncertainty/robust" not in view.arrays:
        return
    from mdstopo.case.text.errors import CaseError
    from mdstopo.robust.conclusion import told
    from mdstopo.store.stored_case import case_of

    try:
        case = case_of(view)
    except CaseError:  # a file that it needs is gone
        case = None
    part, check = view.under("uncertainty"), view.under("uncertainty/validation")
    count = len(view.array("uncertainty/probability"))
    output.say(f"uncertain: {count} points of the sample, {len(check.get('objectives', ()))} of a fresh one")
    rows = [["", "measure", "value", "nominal", "fresh sample", "from", "to", "worse there"]]
    named = zip(view.lines("uncertainty/results"), view.lines("uncertainty/measures"), strict=True)
    for i, (name, measure) in enumerate(named):
        cells = [told(case, name), measure, number(part["robust"][i], 9), number(part["nominal"][i], 9)]
        if check:
            values: Sequence[float] = [check["measured"][i], *check["interval"][i], check["worse"][i]]
            cells += [number(value) for value in values]
        rows.append(cells)
    output.table(rows)


def say_sample(output: Output, case: "Case") -> dict[str, Any] | None:
    """What the sample of a case is; the same for machines."""
    if case.uncertainty is None:
        return None
    from mdstopo.case.responses.response_units import constrained
    from mdstopo.robust.sample import design_sample

    uncertain, sample = case.uncertainty, design_sample(case.uncertainty)
    scenarios = f", {len(uncertain.scenarios)} scenarios" if uncertain.scenarios else ""
    fresh = f", then {uncertain.validation} fresh ones" if uncertain.numbers and uncertain.validation else ""
    output.say(f"uncertain: {len(uncertain.numbers)} numbers{scenarios}; {len(sample)} points{fresh}")
    rows = [["number", "distribution", "nominal", "mean", "deviation", "least", "largest"]]
    told = {}
    for j, number_ in enumerate(uncertain.numbers):
        values = sample.values[:, j]
        mean = float(sample.probability @ values)
        deviation = float(sample.probability @ (values - mean) ** 2) ** 0.5
        found = [number_.nominal, mean, deviation, float(values.min()), float(values.max())]
        rows.append([number_.key, number_.distribution.type, *(number(value) for value in found)])
        told[number_.key] = dict(zip(rows[0][2:], found, strict=True))
    if uncertain.numbers:
        output.table(rows)
    if uncertain.scenarios:
        told_of = [[each.name, number(each.probability), ", ".join(each.values)] for each in uncertain.scenarios]
        output.table([["scenario", "probability", "sets"], *told_of])
    measures = [[name, measure.words] for name, measure in uncertain.objectives.items()]
    for i, measure in uncertain.constraints.items():
        measures.append([f"constraints[{i}] ({constrained(case, case.constraints[i])})", measure.words])
    output.table([["objective or constraint", "measure"], *measures])
    return {"points": len(sample), "numbers": told, "scenarios": [each.name for each in uncertain.scenarios]}
