"""Writes the pictures of single images into a run directory, and says which can't be."""

from __future__ import annotations

from collections.abc import Collection

from p2gd_fgo.report.frame_capture import FrameCapture, Snapshot
from p2gd_fgo.report.p2gd_figures import features_figure, p2gd_figure
from p2gd_fgo.run_directory import RunDirectory
from p2gd_fgo.types import Event


def write_image_figures(
    directory: RunDirectory,
    capture: FrameCapture,
    frames: Collection[int],
    *,
    run: str,
    priors: str,
) -> list[Event]:
    """Write ``figures/p2gd_<number>.png``, or ``features_<number>.png`` where P2GD did not run.

    Parameters
    ----------
    directory
        Of the run.
    capture
        After the run.
    frames
        Image numbers that were asked for; they lie in the recording.
    run
        For the heading.
    priors
        Where prior poses came from.

    Returns
    -------
    list[Event]
        One for each image without its picture, or without what P2GD would have added to it.
    """
    events = []
    for index in sorted(set(frames)):
        snapshot = capture.snapshots.get(index)
        if snapshot is None:
            message = f"no picture of image {index}: the run did not process it"
            events.append(Event(capture.stamp_ns(index), "no_figure", message, {"image": index}))
            continue
        note = _write(directory, capture, snapshot, run, priors)
        if note:
            message = f"the picture of image {index} shows features and quotas alone: {note}"
            data: dict[str, float | int | str] = {"image": index}
            events.append(Event(snapshot.stamp_ns, "figure_without_p2gd", message, data))
    return events


def _write(
    directory: RunDirectory, capture: FrameCapture, snapshot: Snapshot, run: str, priors: str
) -> str:
    """Write the picture; the answer is why it is not what was hoped for, or nothing."""
    distribution = capture.config.distribution
    title = f"{run} · image {snapshot.index} · {snapshot.seconds:.2f} s · {distribution.kind}"
    if snapshot.explanation is None:
        note = f"P2GD did not run: {snapshot.reason}" if distribution.kind == "p2gd" else ""
        path = directory.image_figure("features", snapshot.index)
        features_figure(path, snapshot, title=title, note=note)
        return note
    title += f" · priors: {priors}"
    if distribution.p2gd.when == "before_tracking":
        title += " · decided on the image before"
    path = directory.image_figure("p2gd", snapshot.index)
    p2gd_figure(path, snapshot, capture.camera, distribution.p2gd, title=title)
    return ""
