"""What a fit has found, in words: of `fit`, and of `show`."""

from collections.abc import Mapping
from typing import Any

from mdstopo.cli.output import Output, number
from mdstopo.fit.sentences import correlated, improved, undetermined

Content = Mapping[str, Any]


def say_fit(output: Output, content: Content) -> None:
    """Estimates, what the data cannot tell, what is left of each series. content: of `fit.fit_record.content`."""
    if "value" in content["estimates"][0]:
        output.table(_estimate_rows(content))
        for sentence in (*improved(content), *undetermined(content), *correlated(content)):
            output.say(sentence)
        output.table(_series_rows(content))
    rows = [["simulations", str(content["simulations"])]]
    starts = content["starts"]
    if starts and len(starts) > 1:
        rows.append(["starts", f"{len(starts)}, {content['agreeing']} of them at the same minimum"])
    output.table(rows)


def _told(value: float | None, digits: int = 6) -> str:
    return "-" if value is None else number(value, digits)


def _estimate_rows(content: Content) -> list[list[str]]:
    estimates = content["estimates"]
    profiled = any("profile" in each for each in estimates)
    known = any("low" in each for each in estimates)
    share = f"{100.0 * content['confidence']:g} %"
    head = ["estimate", "value", *(["deviation", f"{share} from", "to"] * known)]
    rows = [[*head, *(["by profile from", "to"] * profiled), "derivative"]]
    for each in estimates:
        cells = [each["name"], number(each["value"], 7)]
        if known:
            cells += [_told(each[key]) for key in ("deviation", "low", "high")]
            cells[2] = f"at {each['at_bound']}" if each["at_bound"] else cells[2]
        if profiled:
            own = each.get("profile", {})
            cells += [_told(own.get(key)) for key in ("low", "high")]
        rows.append([*cells, each["derivative"]])
    return rows


def _series_rows(content: Content) -> list[list[str]]:
    rows = [["series", "values", "root mean square left", "unit", "deviation", "squares / values"]]
    for each in content["series"]:
        low, high = min(each["deviation"]), max(each["deviation"])
        told = number(low, 4) if low == high else f"{number(low, 4)} to {number(high, 4)}"
        estimated, count = each["deviation_estimated"], len(each["t"])
        squares = "" if estimated else number(each["chi_square"] / count, 3)
        rows.append(
            [each["name"], str(count), number(each["root_mean_square"], 4), each["unit"],
             f"{told} (estimated)" if estimated else told, squares]
        )  # fmt: skip
    return rows
