# SPDX-License-Identifier: Apache-2.0
"""What every figure must have: a title in its file, names of all axes, letters that can be read on what is behind."""

from collections.abc import Iterator

import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

_LEGIBLE = 4.5  # contrast of small letters, Web Content Accessibility Guidelines 2.1, criterion 1.4.3


@pytest.fixture(autouse=True)
def checked_figures(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Looks at every figure that a test writes. Import it where figures are drawn."""
    savefig = Figure.savefig
    faults: list[str] = []

    def checked(figure: Figure, path, **options) -> None:
        faults.extend(f"{path}: {fault}" for fault in figure_faults(figure))
        if not any(map(_title, figure.axes)) and not figure.get_suptitle():
            faults.append(f"{path}: no title")  # whoever finds the file has no caption
        savefig(figure, path, **options)

    monkeypatch.setattr(Figure, "savefig", checked)
    yield
    assert not faults, "\n".join(faults)


def figure_faults(figure: Figure) -> list[str]:
    """Axes without names, and texts that hardly differ from the frame of their legend."""
    faults = []
    for number, axes in enumerate(axes for axes in figure.axes if axes.axison):
        faults += [f"axes {number} ({_title(axes) or axes.get_ylabel()}): no {what}" for what in _unnamed(axes)]
        faults += [f"axes {number}: {text!r} of the legend cannot be read" for text in _illegible(axes)]
    return faults


def _unnamed(axes: Axes) -> list[str]:
    if hasattr(axes, "_colorbar"):
        return [] if axes.get_xlabel() or axes.get_ylabel() else ["label"]
    missing = [f"{name} label" for name in "xy" if not _label(axes, name)]
    # rows on one abscissa have a title each, or the highest one alone has
    siblings = axes.get_shared_x_axes().get_siblings(axes)
    column = [other for other in axes.figure.axes if other in siblings and _place(other)[0] == _place(axes)[0]]
    titled = [other for other in column if _title(other)]
    if titled not in ([], column, [min(column, key=_place)]) and axes not in titled:
        missing.append("title")
    return missing


def _place(axes: Axes) -> tuple[int, int]:
    """Column and row of a plot."""
    place = axes.get_subplotspec()
    return (place.colspan.start, place.rowspan.start) if place is not None else (0, 0)


def _title(axes: Axes) -> str:
    return "".join(axes.get_title(place) for place in ("left", "center", "right"))


def _label(axes: Axes, name: str) -> str:
    """Of the axis, or of one that shares its scale; ticks that are words need none."""
    group = axes.get_shared_x_axes() if name == "x" else axes.get_shared_y_axes()
    said = "".join(getattr(other, f"get_{name}label")() for other in group.get_siblings(axes))
    words = (text.get_text() for text in getattr(axes, f"get_{name}ticklabels")())
    return said or "".join(word for word in words if word[:1].isalpha())


def _illegible(axes: Axes) -> list[str]:
    legend = axes.get_legend()
    if legend is None:
        return []
    frame = legend.get_frame()
    behind = _luminance(frame.get_facecolor() if legend.get_frame_on() else axes.figure.get_facecolor())
    contrasts = ((text.get_text(), _contrast(_luminance(text.get_color()), behind)) for text in legend.get_texts())
    return [text for text, contrast in contrasts if contrast < _LEGIBLE]


def _contrast(one: float, other: float) -> float:
    return (max(one, other) + 0.05) / (min(one, other) + 0.05)


def _luminance(colour) -> float:
    """Relative luminance of a colour of sRGB."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)]
    return sum(weight * c for weight, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))
