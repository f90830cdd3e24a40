"""The chi-square gate that a track must pass in either back end."""

from __future__ import annotations

from functools import cache

from scipy.special import gammaincinv


@cache
def track_gate(probability: float, sightings: int) -> float:
    """Largest squared Mahalanobis norm of a track's residuals.

    Two residuals a sighting, less three for the landmark, which they determine too. It is the same
    number as ``scipy.stats.chi2.ppf`` gives; that module takes a second to load.

    Parameters
    ----------
    probability
        Share of good tracks that pass, from 0 to 1.
    sightings
        Of the track, two or more.
    """
    return 2.0 * float(gammaincinv((2 * sightings - 3) / 2, probability))
