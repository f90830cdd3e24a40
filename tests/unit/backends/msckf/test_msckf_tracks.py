"""What becomes of tracks: lost, broken, seen by the oldest image."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.backends.msckf.tracks import Sightings, TrackTable
from p2gd_fgo.types import Observations


def image(ids: list[int], value: float) -> Observations:
    """Feature k is seen at (k, value)."""
    at = np.column_stack([np.array(ids, dtype=float), np.full(len(ids), value)])
    return Observations(0, np.array(ids, dtype=np.int64), at, at)


def described(tracks: Sightings) -> list[tuple[int, list[int], list[float]]]:
    """(id, views, values) of each track."""
    out = []
    for k in range(len(tracks)):
        rows = tracks.track == k
        ids = set(tracks.normalized[rows, 0].tolist())
        assert len(ids) == 1
        views, values = tracks.view[rows].tolist(), tracks.normalized[rows, 1].tolist()
        out.append((int(ids.pop()), views, values))
        assert tracks.lengths[k] == rows.sum()
        assert tracks.starts[k] == np.flatnonzero(rows)[0]
    return sorted(out)


def test_lost_tracks_come_out_with_all_their_sightings() -> None:
    table = TrackTable(6)
    assert len(table.add(image([5, 3, 9], 0.0), 0)) == 0
    assert len(table.add(image([9, 5, 3, 1], 0.1), 1)) == 0
    assert table.observations(2) == 7
    lost = table.add(image([1, 9], 0.2), 2)
    assert described(lost) == [(3, [0, 1], [0.0, 0.1]), (5, [0, 1], [0.0, 0.1])]
    assert table.observations(3) == 5
    assert described(table.take_seen_by_oldest(3)) == [(9, [0, 1, 2], [0.0, 0.1, 0.2])]
    assert described(table.take_all(3)) == [(1, [1, 2], [0.1, 0.2])]
    assert table.observations(3) == 0


def test_a_broken_track_begins_anew_and_an_empty_image_loses_all() -> None:
    table = TrackTable(6)
    table.add(image([4], 0.0), 0)
    assert described(table.add(image([], 0.1), 1)) == [(4, [0], [0.0])]
    assert len(table.add(image([4], 0.2), 2)) == 0
    assert described(table.take_all(3)) == [(4, [2], [0.2])]


def test_dropping_the_oldest_image_moves_the_views() -> None:
    table = TrackTable(3)
    table.add(image([1], 0.0), 0)
    table.add(image([1, 2], 0.1), 1)
    table.add(image([1, 2], 0.2), 2)
    assert described(table.take_seen_by_oldest(3)) == [(1, [0, 1, 2], [0.0, 0.1, 0.2])]
    table.drop_oldest()
    # Track 1 was used; seen again it is another one.
    table.add(image([1, 2], 0.3), 2)
    assert described(table.take_all(3)) == [(1, [2], [0.3]), (2, [0, 1, 2], [0.1, 0.2, 0.3])]


def test_what_an_older_image_saw_is_taken_and_what_is_new_stays() -> None:
    table = TrackTable(4)
    table.add(image([1, 2], 0.0), 0)
    table.add(image([1, 2, 3], 0.1), 1)
    table.add(image([2, 3, 4], 0.2), 2)
    assert described(table.take_older(3)) == [
        (2, [0, 1, 2], [0.0, 0.1, 0.2]),
        (3, [1, 2], [0.1, 0.2]),
    ]
    table.add(image([2, 4], 0.3), 3)
    assert described(table.take_all(4)) == [(2, [3], [0.3]), (4, [2, 3], [0.2, 0.3])]


def test_selection_renumbers() -> None:
    table = TrackTable(4)
    table.add(image([1, 2], 0.0), 0)
    table.add(image([1, 2, 3], 0.1), 1)
    every = table.take_all(2)
    some = every.select(np.array([False, True, True]))
    assert described(some) == [(2, [0, 1], [0.0, 0.1]), (3, [1], [0.1])]
    assert some.track.tolist() == [0, 0, 1]
    assert described(some.with_others(every)) == sorted(described(some) + described(every))
