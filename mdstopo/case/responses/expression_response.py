"""A response that is an expression of other responses, at each time: its keys in a case file, and what they make."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from mdstopo.case.keys.formula_keys import FormulaNames, FormulaText
from mdstopo.case.keys.kinds import NUMBER, Kind, Text
from mdstopo.case.keys.records import Key, Record
from mdstopo.case.objects.frames import Frames
from mdstopo.case.objects.problem_parts import Response
from mdstopo.case.text.reading import Fields, Reading
from mdstopo.case.text.words import inside
from mdstopo.formula.formula_error import FormulaError
from mdstopo.formula.parser import TIME, parse

if TYPE_CHECKING:
    from mdstopo.formula.response_formulas import ResponseProgram


def expression_keys(response: Kind) -> Record:
    """The keys of an expression of responses, each of which is of the kind `response`."""
    return Record(
        "an expression of responses",
        (
            Key(
                "formula",
                FormulaText(),
                "what is looked at, an [expression](expressions.md#responses) of the names in `of` and `parameters`, "
                "and of t (s)",
                required=True,
            ),
            Key("of", FormulaNames(response, "responses", 1), "responses by their name in the formula", required=True),
            Key("parameters", FormulaNames(NUMBER, "numbers"), "numbers by their name in the formula", unit="yours"),
            Key("unit", Text(), "what it is in, for axes and tables", default="-"),
        ),
        doc="An expression of other responses at the same time, before it becomes a number over time. Its kinks and "
        "jumps are located.",
    )


def make_expression(
    word: str,
    keys: Fields,
    response_of: Callable[[Any, Frames, Reading], Response | None],
    frames: Frames,
    reading: Reading,
) -> Response | None:
    """The response; None where there is a mistake, which is noted.

    word, keys: of the response. response_of: makes each of the others from what is stated of it.
    frames, reading: as the maker of any response gets them.
    """
    made = {name: response_of(stated, frames, reading) for name, stated in keys["of"].items()}
    parameters: Mapping[str, float] = keys["parameters"] or {}
    path = inside(keys.path, "formula")
    twice = [name for name in parameters if name in made]
    for name in twice:
        reading.mistake(inside(inside(keys.path, "parameters"), name), f"the name {name!r} is a response already")
    good = not twice and None not in made.values()
    try:
        parse(keys["formula"], (*made, *parameters, TIME))
    except FormulaError as error:
        reading.mistake(path, str(error))
        return None
    if not good:
        return None
    response = Response(
        word, dimension=frames.geometry.number, formula=keys["formula"], unit=keys["unit"],
        of=tuple((name, each) for name, each in made.items() if each is not None),
        parameters=tuple(parameters.items()),
    )  # fmt: skip
    from mdstopo.formula.law_formulas import why_too_large  # most cases have no formulas

    why = why_too_large(lambda: program_of(response).groups)
    if why:
        reading.mistake(path, why)
    return None if why else response


def program_of(response: Response) -> ResponseProgram:
    """The formula of a response with its derivatives. Raises TooManySwitchesError."""
    from mdstopo.formula.response_formulas import response_program  # most cases have no formulas

    names = (*(name for name, _ in response.of), *(name for name, _ in response.parameters))
    # forces of members have a sign in kernels, so that a force that changes its sign is a kink that is located
    signed = tuple(place for place, (_, part) in enumerate(response.of) if part.group is not None)
    return response_program(response.formula, names, len(response.of), signed)
