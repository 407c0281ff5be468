"""The style of pictures."""

from mdstopo.plots.style import new_figure, styled, use_log_scale


def test_a_logarithmic_axis_has_plain_numbers() -> None:
    """The style sets no formulas, which Matplotlib's own labels are."""
    with styled() as module:
        figure, (axis,) = new_figure(module, 1)
        axis.plot([1, 2, 3], [2e-3, 1.0, 30.0])
        use_log_scale(axis)
        figure.canvas.draw()
        labels = [each.get_text() for each in axis.get_yticklabels(which="both")]
    assert {"0.01", "0.1", "1", "10"} <= set(labels)
    assert not any(character in label for label in labels for character in "$\\")
