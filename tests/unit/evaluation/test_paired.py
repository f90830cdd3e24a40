"""Paired comparison: intervals that cover, power that holds, failures that count."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from p2gd_fgo.errors import DataError
from p2gd_fgo.evaluation.bootstrap import EffectKind, by_route, effect
from p2gd_fgo.evaluation.claims import claim, is_shown, span
from p2gd_fgo.evaluation.paired import compare_pairs
from p2gd_fgo.evaluation.power import Spread, detectable, power, routes_needed, spread
from p2gd_fgo.evaluation.synthetic_pairs import PairModel, draw_pairs, spread_over
from p2gd_fgo.types import FloatArray, IntArray

ROUTES = spread_over(30, 12)


def sample(
    seed: int, change: float = -0.2, route: IntArray = ROUTES, model: PairModel | None = None
) -> tuple[FloatArray, FloatArray]:
    return draw_pairs(model or PairModel(), route, change, np.random.default_rng(seed))


@pytest.mark.parametrize(
    "model",
    [PairModel(), PairModel(route_effect=0.5), PairModel(difficulty=1.0, tail="skewed")],
    ids=["as measured", "strong route effect", "hard and skewed"],
)
def test_intervals_cover_a_known_effect(model: PairModel) -> None:
    covered: dict[EffectKind, int] = {"geometric": 0, "mean": 0, "rms": 0}
    rng = np.random.default_rng(2)
    for case in range(1000):
        pairs = by_route(*draw_pairs(model, ROUTES, -0.2, rng), ROUTES)
        for kind in covered:
            found = effect(pairs, kind, draws=399, seed=case)
            assert found is not None
            covered[kind] += found.low <= -0.2 <= found.high
    assert all(920 <= number <= 980 for number in covered.values()), covered


def test_seeds_on_one_route_are_not_independent() -> None:
    # 3 routes with 40 seeds each: what 120 independent pairs would say is far too sure.
    route, covered = spread_over(120, 3), 0
    rng = np.random.default_rng(3)
    for case in range(300):
        pairs = by_route(*draw_pairs(PairModel(), route, 0.0, rng), route)
        found = effect(pairs, "geometric", draws=399, seed=case)
        assert found is not None
        covered += found.verdict == "not shown"
    assert covered >= 276
    one_route = effect(by_route(*sample(0, route=spread_over(9, 1)), spread_over(9, 1)), "mean")
    assert one_route is not None and np.isnan(one_route.low)


def test_effects_are_what_they_are_called() -> None:
    a = np.array([1.0, 2.0, 4.0, 3.0])
    b = np.array([2.0, 1.0, 4.0, 6.0])
    route = np.array([0, 0, 1, 2])  # routes count the same, whatever their number of pairs
    found = compare_pairs(a, b, route.tolist()).effects
    assert found["mean"].change == pytest.approx((1.5 + 4 + 6) / (1.5 + 4 + 3) - 1)
    assert found["rms"].change == pytest.approx(np.sqrt((2.5 + 16 + 36) / (2.5 + 16 + 9)) - 1)
    assert found["geometric"].change == pytest.approx(2 ** (1 / 3) - 1)
    assert found["difference"].change == pytest.approx(1.0)
    side = compare_pairs(a, b, route.tolist()).a
    assert side.mean == pytest.approx(8.5 / 3) and side.rms == pytest.approx(np.sqrt(27.5 / 3))


def test_interval_narrows_to_a_sure_thing_and_repeats() -> None:
    a, _ = sample(4)
    same = effect(by_route(a, a, ROUTES), "rms")
    assert same is not None and (same.low, same.change, same.high) == (0.0, 0.0, 0.0)
    less = effect(by_route(a, 0.5 * a, ROUTES), "mean")
    assert less is not None and less.low == pytest.approx(-0.5) == less.high
    pairs = by_route(*sample(4), ROUTES)
    assert effect(pairs, "mean", seed=7) == effect(pairs, "mean", seed=7)
    shuffled = np.random.default_rng(0).permutation(30)
    a, b = sample(4)
    again = by_route(a[shuffled], b[shuffled], ROUTES[shuffled])
    first, second = effect(pairs, "rms"), effect(again, "rms")
    assert first is not None and second is not None
    assert second.change == pytest.approx(first.change)


def test_wilcoxon_is_on_route_means() -> None:
    a, b = sample(5)
    by_hand = [np.log(b[r == ROUTES].mean() / a[r == ROUTES].mean()) for r in range(12)]
    found = compare_pairs(a, b, ROUTES.tolist()).p_value
    assert found == pytest.approx(stats.wilcoxon(by_hand).pvalue)
    assert compare_pairs(a, a, ROUTES.tolist()).p_value == 1.0


def test_failures_are_counted_and_weigh_in_the_second_reading() -> None:
    a, b = sample(6, -0.4)
    whole = compare_pairs(a, b, ROUTES.tolist())
    assert whole.effects["geometric"].verdict == "less" and whole.penalised == whole.effects
    b[[1, 4, 9, 12, 15, 18, 21, 27]] = np.nan
    a[1] = np.nan
    found = compare_pairs(a, b, ROUTES.tolist())
    assert (found.pairs, found.whole, found.missing_a, found.missing_b) == (30, 22, 1, 8)
    assert found.effects["mean"].change < -0.25
    assert found.penalised["mean"].change > found.effects["mean"].change + 0.1
    assert found.effects["geometric"].verdict == "less"
    text = claim("ATE", found, "geometric", sides=("grid", "p2gd"))
    assert "no difference shown" in text  # the survivors alone would have shown one
    assert "8 of 30 pairs left out, failed or incomplete: 1 of grid, 8 of p2gd" in text
    assert "n = 22 over 12 routes" in text and "with the worst run in their place" in text
    assert found.better_share is not None
    direct = [
        1.0 if np.nan_to_num(y, nan=9e9) < np.nan_to_num(x, nan=9e9) else 0.5 * (x != x and y != y)
        for x, y in zip(a, b, strict=True)
    ]
    assert found.better_share == pytest.approx(np.mean(direct))


def test_a_side_that_always_failed_has_nothing_to_compare() -> None:
    a, _ = sample(7)
    found = compare_pairs(a, np.full(30, np.nan), ROUTES.tolist())
    assert found.effects == {} and found.whole == 0 and found.better_share == 0.0
    assert claim("ATE", found).startswith("ATE: nothing to compare, no pair is whole; 30 of 30")
    assert found.rows[0].pairs == 3 and np.isnan(found.rows[0].mean_a)


def test_the_worst_of_one_group_is_not_put_on_another() -> None:
    a, b = np.array([1.0, 1.0, 1.0, 100.0, 100, 100]), np.array([1, 1, np.nan, 100, 100, 100])
    routes, groups = list("abcdef"), list("rrrccc")
    apart = compare_pairs(a, b, routes, group=groups).penalised["geometric"].change
    assert apart == 0.0
    assert compare_pairs(a, b, routes).penalised["geometric"].change > 1.0


def test_claims_are_worded_by_their_interval() -> None:
    a, b = sample(8, -0.5)
    found = compare_pairs(a, b, ROUTES.tolist())
    shown = claim("ATE", found)
    assert shown.startswith(f"ATE {span(found.effects['mean'])}, n = 30 over 12 routes")
    assert "−" in shown and "-" not in shown
    nothing = compare_pairs(*sample(8, 0.0), ROUTES.tolist())
    assert claim("ATE", nothing).startswith("ATE: no difference shown, ")
    two = compare_pairs(*sample(8, -0.5, spread_over(30, 2)), spread_over(30, 2).tolist())
    assert claim("ATE", two).startswith("ATE: no claim, ")
    tiny = compare_pairs(a, a * np.where(ROUTES % 2, 1.001, 1.002), ROUTES.tolist())
    assert claim("ATE", tiny) == "ATE +0.1 % [+0.1, +0.2], n = 30 over 12 routes"


def test_an_end_that_three_routes_leave_anywhere_has_no_digits() -> None:
    found = compare_pairs(np.ones(3), np.array([0.1, 1.0, 30.0]), list("abc"))
    assert span(found.effects["geometric"]) == "+44 % [−98, > +999]"


def test_shares_have_differences_but_no_ratios() -> None:
    a = np.zeros(12)
    found = compare_pairs(a, a + 0.1, list(range(12)), lower_is_better=False)
    assert set(found.effects) == {"difference"} and found.needed is None
    text = claim("share", found, "difference", unit="points")
    assert text == "share +0.10 points [+0.10, +0.10], n = 12 over 12 routes"
    assert "no ratio" in claim("share", found, "mean")


@pytest.mark.parametrize(
    ("a", "b", "route"),
    [([], [], []), ([1.0], [1.0, 2.0], [0]), ([1.0, 2.0], [1.0, 2.0], [0])],
)
def test_other_lengths_are_refused(a: list[float], b: list[float], route: list[int]) -> None:
    with pytest.raises(DataError, match="pairs"):
        compare_pairs(np.array(a), np.array(b), route)
    with pytest.raises(DataError, match="not finite"):
        by_route(np.array([np.nan]), np.array([1.0]), [0])


def test_variances_are_taken_apart() -> None:
    model = PairModel(route_effect=0.4, run=0.3, common=0.0)
    found = [spread(by_route(*sample(k, route=spread_over(90, 30), model=model),
                             spread_over(90, 30))) for k in range(60)]  # fmt: skip
    between = np.sqrt(np.mean([f.between**2 for f in found if f]))
    within = np.sqrt(np.mean([(f.within or 0.0) ** 2 for f in found if f]))
    assert between == pytest.approx(0.4, rel=0.05)
    assert within == pytest.approx(0.3 * np.sqrt(2), rel=0.05)
    alone = spread(by_route(*sample(0, route=spread_over(12, 12)), spread_over(12, 12)))
    assert alone is not None and alone.within is None


def test_the_routes_needed_have_the_power() -> None:
    model = PairModel(route_effect=0.1, run=0.1, common=0.0)
    known = Spread(0.1, 0.1 * np.sqrt(2))
    routes = routes_needed(known, -0.1, 3)
    assert routes is not None
    assert power(known, -0.1, routes, 3) >= 0.8 > power(known, -0.1, routes - 1, 3)
    smallest = detectable(known, routes, 3)
    assert smallest is not None and -0.1 <= smallest < -0.09
    route, rng, shown = spread_over(3 * routes, routes), np.random.default_rng(1), 0
    for case in range(400):
        pairs = by_route(*draw_pairs(model, route, -0.1, rng), route)
        found = effect(pairs, "geometric", draws=399, seed=case)
        assert found is not None
        shown += found.verdict == "less"
    assert shown / 400 == pytest.approx(power(known, -0.1, routes, 3), abs=0.06)
    assert routes_needed(Spread(50.0, 1.0), -0.01, 1) is None
    assert routes_needed(Spread(0.0, 0.0), -0.01, 1) == 2


def test_a_group_where_all_failed_does_not_take_the_second_reading_away() -> None:
    a, b = sample(6, -0.4)
    routes, groups = ROUTES.tolist(), ["car"] * len(a)
    b[[1, 4, 9, 12, 15, 18, 21, 27]] = np.nan
    alone = compare_pairs(a, b, routes, group=groups)
    lost = np.full(4, np.nan)
    found = compare_pairs(
        np.concatenate([a, lost]), np.concatenate([b, lost]), [*routes, *"xxyy"],
        group=groups + ["robot"] * 4,
    )  # fmt: skip
    assert found.penalised["geometric"] == alone.penalised["geometric"]
    assert "no difference shown" in claim("ATE", found, "geometric")


def test_missing_runs_without_a_worst_one_give_no_claim() -> None:
    a, b = sample(6, -0.4)
    b[:3] = np.nan
    found = compare_pairs(a, b, ROUTES.tolist())
    assert is_shown(found, "geometric")
    assert not is_shown(replace(found, penalised={}), "geometric")
    neither = compare_pairs(a, b, ROUTES.tolist(), lower_is_better=None)
    assert neither.penalised == {} and is_shown(neither, "geometric")
