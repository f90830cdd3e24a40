"""When the next images come: from the recording, or by continuing the recent ones."""

from __future__ import annotations

import numpy as np
from prior_scenes import EPOCH_NS, IMAGE_NS, arc, stamps, window

from p2gd_fgo.priors import ImageTimes


def test_a_recording_knows_its_images() -> None:
    known = np.delete(stamps(30), 12)
    times = ImageTimes(known)
    here = window(arc(known), 10)
    np.testing.assert_array_equal(times.after(int(known[10]), here, 5), known[11:16])
    np.testing.assert_array_equal(times.after(int(known[-3]), here, 5), known[-2:])
    ahead = times.after(int(known[-1]), here, 5)
    assert ahead is not None and len(ahead) == 0


def test_online_the_median_interval_goes_on() -> None:
    known = np.delete(stamps(10), 4)  # one image lost: the mean would be too long
    recent = arc(known)
    ahead = ImageTimes().after(int(known[-1]), recent, 3)
    np.testing.assert_array_equal(ahead, EPOCH_NS + IMAGE_NS * np.arange(10, 13))


def test_one_image_says_nothing_about_the_next() -> None:
    assert ImageTimes().after(EPOCH_NS, arc(stamps(1)), 3) is None
