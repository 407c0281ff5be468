"""The page that shows it all: what the paper says, what is found here, what agrees and what had to be chosen."""

from collections.abc import Sequence
from html import escape

from mdstopo._version import __version__
from mdstopo.store.provenance import Provenance
from reproduce.convergence import ITERATIONS
from reproduce.desk import Desk, Item
from reproduce.front import MIDDLE, WEIGHTS
from reproduce.timing import PAPER

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #1a1a1a; }
h1 { font-size: 1.6rem } h2 { font-size: 1.2rem; margin-top: 2.5rem; border-top: 1px solid #ddd; padding-top: 1rem }
img { max-width: 100%; height: auto } .pictures { display: flex; flex-wrap: wrap; gap: 1rem }
.pictures img { width: 26rem } .pictures img.wide { width: 100% }
table { border-collapse: collapse; margin: 1rem 0 } th, td { border-bottom: 1px solid #ddd; padding: .25rem .8rem;
text-align: left; vertical-align: top } td.number { text-align: right; font-variant-numeric: tabular-nums }
.yes { color: #00694e } .no { color: #b34400; font-weight: 600 }
footer { margin-top: 3rem; color: #555; font-size: .85rem }
"""


def page(desk: Desk, items: Sequence[Item]) -> str:
    """index.html."""
    four, five, six = (desk.numbers(name) for name in ("fig4", "fig5", "fig6"))
    seven, eight, times = (desk.numbers(name) for name in ("fig7", "fig8", "timing"))
    last = six["last"]
    parts = [
        "<h1>The paper's figures and tables, made again</h1>",
        "<p>Two rigid bodies and 1020 springs (the paper's Section IV). Everything below was computed on this machine "
        "by <code>make reproduce</code>; the pictures, the result files and the numbers lie beside this page.</p>",
        _claims(
            [
                (
                    "The three exact methods give the same sensitivities (Fig. 4)",
                    f"they differ by {four['between methods']:.1e} of the largest",
                    four["between methods"] <= 1e-9,
                ),
                (
                    "They agree at all times (Fig. 5)",
                    f"they differ by {five['between methods']:.1e} of the largest at {five['times']} times",
                    five["between methods"] <= 1e-9,
                ),
                (
                    "The exact methods converge to the same result in 50 iterations (Fig. 6)",
                    f"G = {last['adjoint']:.3f}, {last['direct']:.3f}, {last['iterative']:.3f}; "
                    f"{six['exact methods apart']:.1e} apart",
                    six["exact methods apart"] <= 1e-6,
                ),
                (
                    "Constant dynamic loading ends about 10 % away",
                    f"G = {last['constant_load']:.3f}, {100 * six['constant_load apart']:.1f} % above",
                    0.05 <= six["constant_load apart"] <= 0.15,
                ),
                (
                    "Direct and iterative trace the same front (Fig. 7)",
                    f"largest relative difference of an objective {seven['apart']:.1e}",
                    seven["apart"] <= 1e-3,
                ),
                (
                    "An iteration by the iterative method takes less time than by direct",
                    f"{1e3 * times['rows']['iterative']['iteration']:.0f} ms against "
                    f"{1e3 * times['rows']['direct']['iteration']:.0f} ms",
                    times["rows"]["iterative"]["iteration"] < times["rows"]["direct"]["iteration"],
                ),
                (
                    "The adjoint method (AVM) takes the longest",
                    f"{1e3 * times['rows']['adjoint']['iteration']:.1f} ms: here it is the fastest of the exact ones, "
                    "because its reverse sweep works on the bodies, not on the members",
                    times["rows"]["adjoint"]["iteration"] > times["rows"]["direct"]["iteration"],
                ),
            ]
        ),
        _section("fig4", items, ["fig4.png"], (
            f"The first 51 members at alpha = 0.1, generalized_alpha with {four['steps']} steps. The discrete gradient "
            f"differs from that of the exact motion by {four['from the exact motion']:.1e} of the largest entry.",
            "The paper gives no coordinates; the points are this project's reconstruction, so the curve's shape is "
            "not the paper's to the digit.",
        )),
        _section("fig5", items, ["fig5.png"], (
            "dg/dalpha of the first eight members. Direct carries the whole history; for the two others every mark is "
            "a gradient computed anew with the time ending there.",
        ), wide=True),
        _section("fig6", items, ["fig6.png"], (
            f"{ITERATIONS} iterations from alpha = 0.1, where G = {six['start']:.2f}. The four curves of the paper use "
            "the optimality-criteria update (the preset <code>oc</code>): the highest peak alone, move limit 0.2, the "
            "volume spent.",
            f"Our default, which sees every competing peak as a row of its own, reaches {last['default']:.3f} in "
            f"{six['default iterations']} iterations.",
        )),
        "<h2>Times of an iteration</h2>",
        _times(times),
        _section("fig7", items, ["fig7-direct.png", "fig7-iterative.png"], (
            f"{WEIGHTS} weights, weighted exponential sum with p = 2, utopia and maxima found first; every design "
            "visited is a dot. Left direct, right iterative. The circle is the point of weights 0.5 and 0.5: G1 = "
            f"{seven['direct']['middle'][0]:.2f} J, G2 = {seven['direct']['middle'][1]:.2f} J.",
            f"Share of the best hypervolume known: {100 * seven['direct']['hypervolume']:.1f} % and "
            f"{100 * seven['iterative']['hypervolume']:.1f} %.",
        )),
        _section("fig8", items, ["fig8.png", "fig8-layout.png"], (
            f"Point {MIDDLE}: {eight['present']} of {eight['members']} members are present, {eight['grey']} grey; "
            f"volume {eight['volume']:.6f} of 102.",
        )),
        "<h2>What had to be chosen</h2><ul>",
        *(f"<li>{line}</li>" for line in _CHOICES),
        "</ul>",
        f"<footer>mdstopo {escape(__version__)}; {escape(_machine())}.</footer>",
    ]  # fmt: skip
    body = "\n".join(parts)
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>The paper, reproduced</title>'
        f'<meta name="viewport" content="width=device-width"><style>{_STYLE}</style></head>\n'
        f"<body>{body}</body></html>\n"
    )


_CHOICES = (
    "Coordinates: 20 points on a 0.5 m square about body 1, 51 points on a U of body 2; the paper draws them without "
    "numbers.",
    "The volume is spent (an equality): with &ldquo;at most&rdquo; and these numbers, less material stores less "
    "energy.",
    "alpha lies between 0.001 and 1; member stiffness at alpha = 1 is 225 N/m.",
    "t_n is found in continuous time, between steps.",
    "The paper's optimiser settings are not stated; <code>oc</code> is the classical update.",
    "Peaks are competing rows in the front (our default optimiser); the paper does not say how it treats tied peaks.",
)


def _claims(rows: Sequence[tuple[str, str, bool]]) -> str:
    lines = "".join(
        f'<tr><td>{escape(claim)}</td><td>{escape(found)}</td><td class="{"yes" if agrees else "no"}">'
        f"{'agrees' if agrees else 'differs'}</td></tr>"
        for claim, found, agrees in rows
    )
    return f"<table><tr><th>the paper</th><th>here</th><th></th></tr>{lines}</table>"


def _section(
    name: str, items: Sequence[Item], pictures: Sequence[str], sentences: Sequence[str], wide: bool = False
) -> str:
    title = next(item.title for item in items if item.name == name)
    kind = ' class="wide"' if wide else ""
    images = "".join(f'<img{kind} src="{each}" alt="{escape(title)}">' for each in pictures)
    text = "".join(f"<p>{sentence}</p>" for sentence in sentences)
    return f'<h2 id="{name}">{escape(title)}</h2><div class="pictures">{images}</div>{text}'


def _times(times: dict[str, object]) -> str:
    rows = times["rows"]
    assert isinstance(rows, dict)
    lines = []
    for name, row in rows.items():
        paper = PAPER.get(name)
        cells = [
            "" if paper is None else f"{paper:g} s",
            f"{1e3 * row['evaluation']:.3g} ms",
            f"{1e3 * row['iteration']:.3g} ms",
        ]
        numbers = "".join(f'<td class="number">{cell}</td>' for cell in cells)
        lines.append(f"<tr><td>{escape(name)}</td>{numbers}</tr>")
    head = (
        "<tr><th>sensitivity</th><th>paper, an iteration</th><th>evaluation with gradient</th><th>iteration</th></tr>"
    )
    return (
        f"<table>{head}{''.join(lines)}</table><p>generalized_alpha with {times['steps']} steps, but for the last row "
        f"(adaptive collocation, tolerance 1e-8). An iteration is one update of the design and the evaluation of the "
        "new one. The paper's machine: Intel Xeon 3.20 GHz, 8 GB, Windows 7; this one: "
        f"{escape(str(times['machine']))}.</p>"
    )


def _machine() -> str:
    made = Provenance.collect("").attributes()
    return ", ".join(f"{key} {made[key]}" for key in ("python", "numpy", "numba", "platform") if key in made)
