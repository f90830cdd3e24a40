"""Streets or paths as straight pieces between nodes, and a vehicle's way along them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from p2gd_fgo.types import BoolArray, FloatArray, IntArray

_POINT_M = 0.25  # spacing of the points of a way
_RUN_NODES = 20


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A stretch of street to build along, on its right side.

    Attributes
    ----------
    points
        (K, 2) m, K ≥ 2.
    margin_m
        At both ends, that belongs to the crossings.
    """

    points: FloatArray
    margin_m: float

    @property
    def length(self) -> float:
        """Length of the stretch, m."""
        return float(self._arc()[-1])

    def at(self, s: float, reach_m: float = 0.0) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Place (2,) at s m from the start, direction and outward normal (2,) there.

        With ``reach_m`` the direction is that of the chord from s to s + reach_m.
        """
        place, e = self._on(s)
        if reach_m > 0.0 and len(self.points) > 2:
            chord = self._on(s + reach_m)[0] - place
            e = chord / np.linalg.norm(chord)
        return place, e, np.array([e[1], -e[0]])

    def _arc(self) -> FloatArray:
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    def _on(self, s: float) -> tuple[FloatArray, FloatArray]:
        arc = self._arc()
        k = int(np.clip(np.searchsorted(arc, s, "right") - 1, 0, len(arc) - 2))
        e = (self.points[k + 1] - self.points[k]) / (arc[k + 1] - arc[k])
        return self.points[k] + (s - arc[k]) * e, e


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """Where one can drive.

    Attributes
    ----------
    nodes
        (N, 2) m.
    edges
        (E, 2) node indices, each pair once.
    width_m
        Of all streets.
    crossings
        Whether the nodes are crossings, or bends of one long street.
    walk
        (W,) the nodes that the vehicle passes, in order.
    """

    nodes: FloatArray
    edges: IntArray
    width_m: float
    crossings: bool
    walk: IntArray

    def clearance(self, points: FloatArray) -> FloatArray:
        """Distance (P,) of points (P, 2) from the nearest street's border, negative inside."""
        a, b = self.nodes[self.edges[:, 0]], self.nodes[self.edges[:, 1]]
        along = b - a
        squared = np.einsum("ei,ei->e", along, along)
        nearest = np.full(len(points), np.inf)
        for k in range(len(a)):
            share = np.clip((points - a[k]) @ along[k] / squared[k], 0.0, 1.0)
            gap = np.linalg.norm(points - a[k] - share[:, None] * along[k], axis=1)
            nearest = np.minimum(nearest, gap)
        return np.asarray(nearest - 0.5 * self.width_m)

    def runs(self) -> list[Run]:
        """Both sides of all streets, in stretches between crossings or of some 80 m."""
        half = 0.5 * self.width_m
        if self.crossings:
            ends = [pair for i, j in self.edges.tolist() for pair in ((i, j), (j, i))]
            return [Run(self.nodes[list(pair)], half) for pair in ends]
        cuts = range(0, len(self.nodes) - 1, _RUN_NODES)
        parts = [self.nodes[k : k + _RUN_NODES + 1] for k in cuts]
        return [Run(p, 0.0) for part in parts for p in (part, part[::-1])]

    def on_walk(self) -> BoolArray:
        """Which edges (E,) the vehicle drives along."""
        driven = {frozenset(pair) for pair in pairwise(self.walk.tolist())}
        return np.array([frozenset(e) in driven for e in self.edges.tolist()])


def random_network(
    length_m: float,
    block_m: tuple[float, float],
    turn_share: float,
    width_m: float,
    rng: np.random.Generator,
    *,
    jitter: float = 0.0,
) -> Network:
    """A lattice of uneven blocks, as far as a random walk over ``length_m`` comes near it.

    The walk starts in the middle of a block of its own, in the origin, heading along x.

    Parameters
    ----------
    jitter
        How far nodes are off the lattice, as a share of the shortest block.
    """
    reach = int(length_m / block_m[0]) + 3
    lines = [_lines(reach, block_m, rng) for _ in range(2)]
    shift = lines[0][reach] + 0.5 * (lines[0][reach + 1] - lines[0][reach])
    lines[0] = lines[0] - shift
    lines[1] = lines[1] - lines[1][reach]
    offsets = rng.uniform(-jitter, jitter, (2 * reach + 1, 2 * reach + 1, 2)) * block_m[0]
    offsets[reach : reach + 2, reach] = 0.0

    def place(node: tuple[int, int]) -> FloatArray:
        i, j = node
        return np.asarray(np.array([lines[0][i], lines[1][j]]) + offsets[i, j])

    here, heading = (reach + 1, reach), (1, 0)
    walk = [(reach, reach), here]
    driven = float(place(here)[0])
    while driven < length_m + 0.5 * block_m[1]:
        left, right = (-heading[1], heading[0]), (heading[1], -heading[0])
        if rng.random() < turn_share:
            heading = left if rng.random() < 0.5 else right
        # Turn back inside before the lattice ends.
        inside = [
            h
            for h in (heading, left, right)
            if all(1 <= c + d <= 2 * reach - 1 for c, d in zip(here, h, strict=True))
        ]
        heading = inside[0]
        following = (here[0] + heading[0], here[1] + heading[1])
        driven += float(np.linalg.norm(place(following) - place(here)))
        here = following
        walk.append(here)
    around = [(1, 0), (-1, 0), (0, 1), (0, -1)]
    pairs: dict[tuple[tuple[int, int], tuple[int, int]], None] = {}
    for i, j in walk:
        for di, dj in around:
            neighbour = (i + di, j + dj)
            if all(0 <= c <= 2 * reach for c in neighbour):
                ends = sorted([(i, j), neighbour])
                pairs[(ends[0], ends[1])] = None
    names: dict[tuple[int, int], int] = {}
    for pair in pairs:
        for node in pair:
            names.setdefault(node, len(names))
    return Network(
        np.array([place(node) for node in names]),
        np.array([[names[a], names[b]] for a, b in pairs]),
        width_m,
        True,
        np.array([names[node] for node in walk]),
    )


def network_of_route(
    points: FloatArray, width_m: float, rng: np.random.Generator, *, piece_m: float = 4.0
) -> Network:
    """One street along a driven line (N, 2), some metres longer at both ends."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    moving = np.concatenate([[True], steps > 1e-3])
    points = points[moving]
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    if arc[-1] < 2.0:  # it hardly moves: a street in any direction
        heading = rng.uniform(0.0, 2.0 * np.pi)
        forward = np.array([np.cos(heading), np.sin(heading)])
        points, arc = np.array([points[0], points[0] + 2.0 * forward]), np.array([0.0, 2.0])
    s = np.linspace(0.0, arc[-1], max(int(arc[-1] / piece_m), 1) + 1)
    nodes = np.column_stack([np.interp(s, arc, points[:, k]) for k in range(2)])
    first, last = nodes[0] - nodes[1], nodes[-1] - nodes[-2]
    first, last = (60.0 * v / max(np.linalg.norm(v), 1e-9) for v in (first, last))
    nodes = np.vstack([nodes[0] + first, nodes, nodes[-1] + last])
    walk = np.arange(len(nodes))
    return Network(nodes, np.column_stack([walk[:-1], walk[1:]]), width_m, False, walk)


def way_along(
    corners: FloatArray, offsets: FloatArray, radius_m: float, smooth_m: float
) -> FloatArray:
    """Points (P, 2) every 0.25 m of a way with round corners.

    Parameters
    ----------
    corners
        (C, 2) in order.
    offsets
        (C − 1,) m to the right of each piece; a change inside a piece is not one of these.
    radius_m
        Of the turns.
    smooth_m
        1 sigma of the smoothing along the way, which eases into the turns.
    """
    directions = np.diff(corners, axis=0)
    lengths = np.linalg.norm(directions, axis=1)
    directions = directions / lengths[:, None]
    right = np.column_stack([directions[:, 1], -directions[:, 0]])
    starts = corners[:-1] + offsets[:, None] * right
    ends = corners[1:] + offsets[:, None] * right
    points = [starts[:1]]
    for k in range(len(directions)):
        if k + 1 == len(directions):
            points.append(ends[-1:])
            break
        turn = _angle(directions[k], directions[k + 1])
        if abs(turn) < 0.02:
            # The offset changes on the first third of the next piece.
            after = starts[k + 1] + directions[k + 1] * lengths[k + 1] / 3.0
            points.append(_ease(ends[k], after, directions[k]))
            continue
        corner = _meet(starts[k], directions[k], starts[k + 1], directions[k + 1])
        room = 0.45 * min(lengths[k], lengths[k + 1])
        radius = min(radius_m, room / np.tan(0.5 * abs(turn)))
        before = radius * np.tan(0.5 * abs(turn))
        begin = corner - before * directions[k]
        normal = np.sign(turn) * np.array([-directions[k, 1], directions[k, 0]])
        center = begin + radius * normal
        angles = np.linspace(0.0, turn, max(int(radius * abs(turn) / _POINT_M), 2))
        c, s = np.cos(angles), np.sin(angles)
        arm = begin - center
        arc = np.column_stack([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]])
        points.append(center + arc)
    line = np.vstack(points)
    return _smoothed(_even(line), smooth_m)


def _lines(reach: int, block_m: tuple[float, float], rng: np.random.Generator) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum(rng.uniform(*block_m, 2 * reach))])


def _angle(a: FloatArray, b: FloatArray) -> float:
    return float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))


def _meet(p: FloatArray, d: FloatArray, q: FloatArray, e: FloatArray) -> FloatArray:
    """Where the lines p + t d and q + s e meet."""
    t = np.linalg.solve(np.column_stack([d, -e]), q - p)[0]
    return np.asarray(p + t * d)


def _ease(start: FloatArray, end: FloatArray, direction: FloatArray) -> FloatArray:
    """An S from start to end, both ends along ``direction``."""
    t = np.linspace(0.0, 1.0, 40)[:, None]
    aside = t**3 * (10.0 - 15.0 * t + 6.0 * t * t)
    way = end - start
    along = (way @ direction) * direction
    return np.asarray(start + t * along + aside * (way - along))


def _even(line: FloatArray) -> FloatArray:
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    line = line[np.concatenate([[True], steps > 1e-6])]
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    s = np.arange(0.0, arc[-1], _POINT_M)
    return np.column_stack([np.interp(s, arc, line[:, k]) for k in range(2)])


def _smoothed(line: FloatArray, sigma_m: float) -> FloatArray:
    reach = int(4.0 * sigma_m / _POINT_M) + 1
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) * _POINT_M / sigma_m) ** 2)
    weights /= weights.sum()
    first, last = line[1] - line[0], line[-1] - line[-2]
    ramp = np.arange(1, reach + 1)[:, None]
    padded = np.vstack([line[0] - ramp[::-1] * first, line, line[-1] + ramp * last])
    return np.column_stack([np.convolve(padded[:, k], weights, mode="valid") for k in range(2)])
