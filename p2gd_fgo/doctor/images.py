"""Black, frozen and badly exposed images among those looked at."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.doctor.flow import FlowSample
from p2gd_fgo.doctor.report import Finding, Status, Value

_MAX_BAD = 0.02  # of the images looked at
_RUINED = 0.3
_DARK, _BRIGHT = 25.0, 230.0  # grey levels
_CLIPPED = 0.25  # of an image's pixels
_MIN_TRACKS = 40  # features that survive from image to image, of 200


def check_images(sample: FlowSample) -> list[Finding]:
    """Judge what :func:`p2gd_fgo.doctor.flow.follow` has seen."""
    return [_content(sample), _exposure(sample), _tracks(sample)]


def _content(sample: FlowSample) -> Finding:
    total = len(sample.images) + len(sample.unreadable)
    counts = {
        "black": len(sample.black),
        "frozen": len(sample.frozen),
        "unreadable": len(sample.unreadable),
    }
    bad = sum(counts.values())
    share = bad / max(total, 1)
    value = f"{total} looked at"
    if bad:
        value += ": " + ", ".join(f"{n} {name}" for name, n in counts.items() if n)
    status: Status = "ok"
    if bad:
        status = "fault" if share > _RUINED else "warning" if share > _MAX_BAD else "note"
    worst = max(counts, key=lambda name: counts[name])
    judged = status in ("warning", "fault")
    return Finding(
        "image content",
        status,
        value,
        f"at most {100 * _MAX_BAD:g} % black, frozen or unreadable",
        "look at the camera's driver; dataset.start_s and duration_s leave a part out"
        if judged
        else "",
        f"images_{worst}" if judged else None,
        {**counts, "looked_at": total},
    )


def _exposure(sample: FlowSample) -> Finding:
    means, clipped = np.array(sample.means), np.array(sample.clipped)
    if len(means) == 0:
        return Finding("exposure", "undetermined", "no image could be read")
    bad = (means < _DARK) | (means > _BRIGHT) | (clipped > _CLIPPED)
    share = float(bad.mean())
    value = f"mean grey {np.median(means):.0f} ({means.min():.0f} to {means.max():.0f})"
    value += f", {100 * np.median(clipped):.1f} % of the pixels at 255"
    judged = share > 0.2
    data: dict[str, Value] = {"mean": float(np.median(means)), "bad_share": share}
    return Finding(
        "exposure",
        "warning" if judged else "ok",
        value,
        f"{_DARK:g} to {_BRIGHT:g}, < {100 * _CLIPPED:g} % clipped, in 80 % of the images",
        "let the camera choose its exposure" if judged else "",
        "exposure" if judged else None,
        data,
    )


def _tracks(sample: FlowSample) -> Finding:
    survivors = [len(pair.a) for pair in sample.pairs]
    median = float(np.median(survivors)) if survivors else 0.0
    poor = median < _MIN_TRACKS
    return Finding(
        "features",
        "warning" if poor else "ok",
        f"{median:.0f} followed from image to image in the median",
        f"≥ {_MIN_TRACKS}",
        "more light, more texture, or a higher image rate" if poor else "",
        "few_features" if poor else None,
        {"median": median},
    )
