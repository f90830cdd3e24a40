"""The look that a method has in every figure of a report."""

from __future__ import annotations

from dataclasses import dataclass

from p2gd_fgo.report.pages.collection import Collection, Method

LineStyle = str | tuple[int, tuple[int, ...]]

# Okabe and Ito's colours, told apart by every kind of colour vision.
_COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c564b", "#7f7f7f")
_MARKERS = "os^DvPX*"
_DASHES: tuple[LineStyle, ...] = ("-", (0, (4, 1)), (0, (1, 1)), (0, (4, 1, 1, 1)))


@dataclass(frozen=True, slots=True)
class Style:
    """Of a method: name in the legend, colour, dashes, and a marker that goes with the colour."""

    name: str
    color: str
    dashes: LineStyle
    marker: str


def styles(collection: Collection) -> dict[Method, Style]:
    """A style for each method: dashes tell back ends apart where something else differs too."""
    backend = collection.axes.index("backend") if "backend" in collection.axes else None
    rest = [_without(method, backend) for method in collection.methods]
    both = backend is not None and len(set(rest)) > 1
    keys = rest if both else list(collection.methods)
    colors = {key: k for k, key in enumerate(dict.fromkeys(keys))}
    backends = list(dict.fromkeys(m[backend] for m in collection.methods)) if both else []  # type: ignore[index]
    found = {}
    for method, key in zip(collection.methods, keys, strict=True):
        k = colors[key]
        dash = backends.index(method[backend]) if both else k // len(_COLORS)  # type: ignore[index]
        name = collection.name(method)
        look = k % len(_COLORS)
        found[method] = Style(name, _COLORS[look], _DASHES[dash % len(_DASHES)], _MARKERS[look])
    return found


def _without(method: Method, axis: int | None) -> tuple[object, ...]:
    return tuple(label for k, label in enumerate(method) if k != axis)
