"""Textures, light and the placing of things."""

from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.simulation import materials
from p2gd_fgo.simulation.furniture import KINDS, lawn
from p2gd_fgo.simulation.lighting import Sun, bake
from p2gd_fgo.simulation.site import Site
from p2gd_fgo.simulation.textures import build_atlas, noise
from p2gd_fgo.simulation.world import Look, box, concatenate, patches


def test_mip_levels_keep_the_mean() -> None:
    image = materials.concrete(np.random.default_rng(1), 64)
    atlas = build_atlas([image, np.full((4, 8), 50.0, np.float32)])
    for offset, width, height in atlas.levels[0]:
        level = atlas.texels[offset : offset + width * height]
        assert level.mean() == pytest.approx(image.mean(), abs=0.6)
    assert tuple(atlas.levels[0, -1, 1:]) == (1, 1)
    assert tuple(atlas.levels[1, 0, 1:]) == (8, 4)


def test_a_texture_of_an_odd_size_is_refused() -> None:
    with pytest.raises(ValueError, match="48 x 32"):
        build_atlas([np.zeros((32, 48), np.float32)])


@pytest.mark.parametrize("material", [materials.asphalt, materials.slabs, materials.grass])
def test_borders_of_ground_textures_join(material) -> None:  # type: ignore[no-untyped-def]
    image = material(np.random.default_rng(2), 512)
    steps = np.abs(np.diff(image, axis=1)).mean(0)
    seam = np.abs(image[:, 0] - image[:, -1]).mean()
    assert seam < 1.3 * max(steps.max(), np.median(steps))
    assert image.std() > 8.0


def test_noise_is_periodic_and_seeded() -> None:
    a, b = (noise(np.random.default_rng(4), (64, 128), 32) for _ in range(2))
    np.testing.assert_array_equal(a, b)
    assert a.std() == pytest.approx(1.0, abs=0.25)
    assert np.abs(a[0] - a[-1]).mean() < 1.5 * np.abs(np.diff(a, axis=0)).mean(1).max()


def test_the_shadow_of_a_box_lies_where_the_sun_says() -> None:
    look = Look(0)
    ground = patches([-8.0, -8.0, 0.0], [16.0, 0.0, 0.0], [0.0, 16.0, 0.0], look)
    surfaces = concatenate([ground, box([0.0, 0.0, 0.0], [1.0, 1.0, 2.0], 0.0, look)])
    sun = Sun((1.0, 0.0, 1.0), strength=1.0)
    light = bake(surfaces, sun, np.random.default_rng(0))
    offset, columns, rows = light.grids[0]
    grid = light.values[offset : offset + columns * rows].reshape(rows, columns)

    def at(x: float, y: float) -> float:
        return float(grid[int((y + 8.0) / 16.0 * rows), int((x + 8.0) / 16.0 * columns)])

    shaded = [at(-1.0, 0.0), at(-2.2, 0.3), at(-2.2, -0.3)]
    sunny = [at(-2.8, 0.0), at(1.0, 0.0), at(-1.5, 0.8), at(-1.5, -0.8)]
    assert max(shaded) < min(sunny)


def test_nothing_stands_on_the_route() -> None:
    route = np.column_stack([np.linspace(-6.0, 6.0, 60), np.sin(np.linspace(0.0, 4.0, 60))])
    site = Site(np.random.default_rng(8), route, np.full(2, -12.0), np.full(2, 12.0))
    for build in (lawn, lawn, *KINDS, *KINDS):
        build(site)
    assert len(site.parts) > 20
    built = concatenate(site.parts)
    corners = np.concatenate(
        [
            built.corner,
            built.corner + built.edge_u,
            built.corner + built.edge_v,
            built.corner + built.edge_u + built.edge_v,
        ]
    )
    low = corners[corners[:, 2] < 1.5][:, :2]
    gap = np.linalg.norm(low[:, None] - route[None], axis=2).min()
    assert gap > 0.9
