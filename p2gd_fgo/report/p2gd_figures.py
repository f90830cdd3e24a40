"""Pictures of what P2GD sees, predicts and decides for one image (paper Figs. 9 and 10)."""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke

from p2gd_fgo.atomic_files import atomic_path
from p2gd_fgo.config import P2gdConfig
from p2gd_fgo.distribution.base import Explanation
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.report.figures import FRAME, TEXT, finish
from p2gd_fgo.report.frame_capture import Snapshot
from p2gd_fgo.types import FloatArray, Image, IntArray

# Okabe and Ito's colours, told apart by every kind of colour vision, and by the marker as well.
_TRIANGULATED, _KEPT, _PATH, _NEW = "#d55e00", "#009e73", "#0072b2", "#f0e442"
_COLORS = "viridis"
_IMAGE_IN = (7.4, 3.7)  # largest width and height of an image on the page
_TOP_VIEW_IN = 5.0
_MASKED, _HATCH = (0.1, 0.1, 0.15, 0.5), (1.0, 1.0, 1.0, 0.6)
_OUTLINE = [withStroke(linewidth=2.2, foreground="black")]
_UNITS = {
    "total_parallax": ("total parallax (°)", 180.0 / np.pi),
    "track_length": ("length (images)", 1.0),
}


def p2gd_figure(
    path: Path, snapshot: Snapshot, camera: Camera, config: P2gdConfig, *, title: str
) -> None:
    """Write a PNG with three panels: weights and quotas, predicted tracks, the scene from above.

    Parameters
    ----------
    path
        The PNG; replaced as a whole.
    snapshot
        With an explanation.
    camera
        Its lens decides how wide the field of view is drawn.
    config
        Decides what the weights mean.
    title
        The heading.
    """
    why = snapshot.explanation
    if why is None:
        raise ValueError(f"image {snapshot.index} has no explanation")
    figure, width = _page(snapshot.image, title, beside_in=_TOP_VIEW_IN)
    grid = figure.add_gridspec(2, 2, width_ratios=[width, _TOP_VIEW_IN])
    heat, tracks = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
    unit, factor = _UNITS[config.weight]
    values = factor * why.values
    best = float(np.percentile(values, 90)) if len(values) else 0.0
    if config.allocate == "d_optimal":  # the cells' weights are gains, of another kind than values
        weights = why.weights
        in_cells, of_tracks = _scale(weights.max()), _scale(best)
        _bar(figure, in_cells, [heat], "first feature's gain (log det)")
        _bar(figure, of_tracks, [tracks], f"predicted {unit}")
    else:
        weights = factor * why.weights
        in_cells = of_tracks = _scale(max(weights.max(), best))
        _bar(figure, of_tracks, [heat, tracks], f"predicted {unit}")

    covered = _image(heat, snapshot)
    _cells(heat, snapshot.image, weights, in_cells)
    _quotas(heat, snapshot.image, why.quotas)
    _features(heat, snapshot)
    _caption(
        heat,
        f"cell weights (no colour: no 3-D feature) and quotas, {why.quotas.sum()} in all{covered}",
    )
    _image(tracks, snapshot)
    _predicted(tracks, why, values, of_tracks)
    _caption(
        tracks,
        f"predicted tracks of {len(values)} 3-D features over {len(why.T_world_cam) - 1} images",
    )
    panel = float(figure.get_size_inches()[1] - 1.1) / (_TOP_VIEW_IN - 0.6)
    _top_view(figure.add_subplot(grid[:, 1]), why, camera, panel)
    _save(figure, path)


def features_figure(path: Path, snapshot: Snapshot, *, title: str, note: str = "") -> None:
    """Write a PNG of the features over the image, with the quotas of the cells if there are any.

    ``path``, ``snapshot`` and ``title`` as in :func:`p2gd_figure`; ``note`` is a remark below.
    """
    figure, _ = _page(snapshot.image, title, images=1)
    axes = figure.add_subplot()
    covered = _image(axes, snapshot)
    text = "features"
    if note:
        wrapped = textwrap.fill(note, 95)
        figure.supxlabel(wrapped, x=0.012, ha="left", fontsize=9, color=TEXT, parse_math=False)
    if snapshot.quotas is not None:
        _cells(axes, snapshot.image, np.zeros(snapshot.quotas.shape), None)
        _quotas(axes, snapshot.image, snapshot.quotas)
        text += f" and quotas, {snapshot.quotas.sum()} in all"
    _features(axes, snapshot)
    _caption(axes, text + covered)
    _save(figure, path)


def _page(
    image: Image, title: str, *, images: int = 2, beside_in: float = 0.0
) -> tuple[Figure, float]:
    """A figure, and the width in inches of the images stacked on its left, with their bars."""
    aspect = image.shape[1] / image.shape[0]
    width = min(_IMAGE_IN[0], _IMAGE_IN[1] * aspect)
    height = width / aspect
    room = images * (height + 0.4) + 0.4
    figure = Figure(
        figsize=(width + beside_in + 1.0, max(room, 4.6 if beside_in else 0.0)), dpi=120
    )
    figure.set_layout_engine("constrained", w_pad=0.05, h_pad=0.05)
    FigureCanvasAgg(figure)
    figure.suptitle(title, x=0.012, ha="left", fontsize=12, fontweight="bold", parse_math=False)
    return figure, width + 1.0


def _scale(top: float) -> ScalarMappable:
    return ScalarMappable(Normalize(0.0, float(top) or 1.0), _COLORS)


def _bar(figure: Figure, scale: ScalarMappable, axes: list[Axes], label: str) -> None:
    aspect = 60 if len(axes) > 1 else 30
    bar = figure.colorbar(scale, ax=axes, fraction=0.03, pad=0.01, aspect=aspect, extend="max")
    bar.set_label(label, fontsize=9)
    bar.ax.tick_params(labelsize=8, color=FRAME)
    bar.outline.set_edgecolor(FRAME)


def _image(axes: Axes, snapshot: Snapshot) -> str:
    """Draw the image, paler, so that what lies over it is seen; hatched where a mask covers it.

    The answer is what the caption must say of the mask.
    """
    image, masked = snapshot.image, snapshot.masked
    axes.imshow(image, cmap="gray", vmin=-110, vmax=275, interpolation="antialiased")
    axes.set_xlim(-0.5, image.shape[1] - 0.5)
    axes.set_ylim(image.shape[0] - 0.5, -0.5)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_color(FRAME)
    if masked is None:
        return ""
    shade = np.zeros((*masked.shape, 4))
    shade[masked] = _MASKED
    axes.imshow(shade, interpolation="nearest")
    if masked.any():
        hatches = axes.contourf(masked, levels=[0.5, 1.5], colors="none", hatches=["////"])
        hatches.set_edgecolor(_HATCH)
        hatches.set_linewidth(0.0)
    return f"; hatched: masked, {100.0 * masked.mean():.0f} % of the image"


def _cells(axes: Axes, image: Image, weights: FloatArray, scale: ScalarMappable | None) -> None:
    rows, columns = weights.shape
    width, height = image.shape[1] / columns, image.shape[0] / rows
    for row, column in np.ndindex(rows, columns):
        weight = weights[row, column]
        colored = scale is not None and weight > 0.0
        axes.add_patch(
            Rectangle(
                (column * width - 0.5, row * height - 0.5),
                width,
                height,
                facecolor=scale.to_rgba(weight, alpha=0.55) if scale and colored else "none",
                edgecolor=(1.0, 1.0, 1.0, 0.55),
                lw=0.7,
            )
        )


def _quotas(axes: Axes, image: Image, quotas: IntArray) -> None:
    rows, columns = quotas.shape
    width, height = image.shape[1] / columns, image.shape[0] / rows
    for row, column in np.ndindex(rows, columns):
        quota = int(quotas[row, column])
        axes.text(
            (column + 0.5) * width, (row + 0.5) * height, str(quota),
            ha="center", va="center", fontsize=11, fontweight="bold" if quota else "normal",
            color="white" if quota else "#b8bcc2", path_effects=_OUTLINE, zorder=4,
        )  # fmt: skip


def _features(axes: Axes, snapshot: Snapshot) -> None:
    for which, marker, size, color, name in (
        (~snapshot.new, "o", 3.6, "white", "tracked"),
        (snapshot.new, "D", 3.9, _NEW, "new"),
    ):
        axes.plot(
            *snapshot.pixels[which].T, ls="", marker=marker, ms=size, mfc=color, mec="black",
            mew=0.5, label=f"{int(which.sum())} {name}", zorder=3,
        )  # fmt: skip
    axes.legend(
        loc="upper right", bbox_to_anchor=(1.005, 0.01), ncols=2, fontsize=9, frameon=False,
        labelcolor=TEXT, handletextpad=0.1, columnspacing=1.2, borderpad=0.2,
    )  # fmt: skip


def _predicted(axes: Axes, why: Explanation, values: FloatArray, scale: ScalarMappable) -> None:
    """Draw from the current pixel (dot) through the predicted ones; the best on top."""
    if len(values) == 0:
        axes.text(0.5, 0.5, "no 3-D features", transform=axes.transAxes, ha="center", color="white")
        return
    order = np.argsort(values, kind="stable")
    lines = [why.pixels[i][np.isfinite(why.pixels[i, :, 0])] for i in order]
    colors = scale.to_rgba(values[order])
    axes.add_collection(LineCollection(lines, colors="black", linewidths=2.4, alpha=0.5))
    axes.add_collection(LineCollection(lines, colors=colors, linewidths=1.3))
    ahead = np.concatenate([line[1:] for line in lines])
    axes.scatter(
        ahead[:, 0],
        ahead[:, 1],
        s=3.0,
        c=np.repeat(colors, [len(line) - 1 for line in lines], axis=0),
    )
    now = why.pixels[order, 0]
    axes.scatter(
        now[:, 0], now[:, 1], s=17.0, c=colors, edgecolors="white", linewidths=0.8, zorder=3
    )


def _top_view(axes: Axes, why: Explanation, camera: Camera, shape: float) -> None:
    """Draw in metres ahead of and to the right of the camera, in a panel of height / width."""
    right, ahead = _heading(why.T_world_cam[0])

    def seen(points: FloatArray) -> FloatArray:
        return (points - why.T_world_cam[0, :3, 3]) @ np.stack([right, ahead], axis=1)

    points, path = seen(why.points), seen(why.T_world_cam[:, :3, 3])
    reach = max(float(np.abs(points).max(initial=0.0)), float(np.abs(path).max()), 1.0)
    edges = camera.undistort(np.array([[0.0, camera.cy], [camera.width - 1.0, camera.cy]]))[:, 0]
    for edge in edges.tolist():
        ray = np.array([edge, 1.0]) / np.hypot(edge, 1.0) * 1.5 * reach
        axes.plot([0.0, ray[0]], [0.0, ray[1]], color="#9aa0a8", lw=1.0, ls=(0, (5, 4)), zorder=1)
    for which, marker, color, name in (
        (why.kept, "o", _KEPT, "kept in the buffer"),
        (~why.kept, "^", _TRIANGULATED, "triangulated in this image"),
    ):
        axes.scatter(
            points[which, 0], points[which, 1], s=30, marker=marker, c=color,
            edgecolors="white", linewidths=0.5,
            label=f"{name} ({int(which.sum())})", zorder=3,
        )  # fmt: skip
    axes.plot(*path.T, color=_PATH, lw=1.6, marker=".", ms=5, label="predicted path", zorder=4)
    axes.plot(
        0.0, 0.0, ls="", marker="s", ms=8, mfc="white", mec=_PATH, mew=2.0, label="camera", zorder=5
    )
    low, high = _frame(np.concatenate([points, path]), shape)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal", adjustable="box", anchor="N")
    finish(axes, "ahead of the camera (m)", "right of the camera (m)")
    _caption(axes, "3-D features from above; dashed: field of view")
    axes.legend(loc="best", fontsize=9, framealpha=0.9, edgecolor=FRAME)


def _frame(points: FloatArray, shape: float) -> tuple[FloatArray, FloatArray]:
    """Corners (2,) of a box of height / width around points (N, 2); spare height goes on top."""
    low, high = points.min(axis=0), points.max(axis=0)
    width, height = 1.1 * np.maximum(high - low, 1.0)
    width, height = max(width, height / shape), max(height, shape * width)
    corner = np.array([0.5 * (low[0] + high[0]) - 0.5 * width, low[1] - 0.05 * height])
    return corner, corner + np.array([width, height])


def _heading(T_world_cam: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (3,) to the right and ahead of a camera, in the world's horizontal plane."""
    z, y = T_world_cam[:3, 2], T_world_cam[:3, 1]
    ahead = z if np.hypot(z[0], z[1]) > 0.1 else -y  # one that looks straight down: up in its image
    ahead = np.array([ahead[0], ahead[1], 0.0]) / np.hypot(ahead[0], ahead[1])
    return np.array([ahead[1], -ahead[0], 0.0]), ahead


def _caption(axes: Axes, text: str) -> None:
    axes.set_title(text, loc="left", fontsize=10, color=TEXT)


def _save(figure: Figure, path: Path) -> None:
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format="png", bbox_inches="tight", pad_inches=0.08)
