"""Sweeps of one scene at several values of its keys: the levels, their summaries, and the plot of them."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from msrr_bullet.figures.plots.style import styled
from msrr_bullet.statistics import wilson
from msrr_bullet.sweep import variation_plot
from msrr_bullet.sweep.sweep import run_sweep
from msrr_bullet.sweep.variation import MAX_LEVELS, Variation, levels, load_levels, run_variation
from msrr_bullet.sweep.variation_plot import check_plot, plot_variation
from msrr_scenes import load_scene
from msrr_scenes.errors import MsrrError, SceneError
from tests.bullet.conftest import inline
from tests.bullet.sweep.conftest import made_up

LATENCY, CONTROLLER = "cameras.onboard.latency_ms", "control.docking"


@pytest.fixture(scope="module")
def varied() -> Variation:
    values = {LATENCY: [20, 60.0, "120"], CONTROLLER: ["c1", "linear"]}
    return run_variation("close_range", values, range(8), executor=inline, trial=made_up)


def test_levels_are_all_combinations_and_the_last_key_varies_fastest() -> None:
    found = levels({"a": [0, "1e-3"], "b": [[1, 2], True, {"name": "c1"}]})
    assert found == [{"a": a, "b": b} for a in ("0", "1e-3") for b in ("[1, 2]", "true", "{name: c1}")]
    assert levels({}) == [{}]
    assert levels({"a": [{"unit": "a", "to": "b"}]}) == [{"a": "{unit: a, to: b}"}]


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"a": []}, "a: expected a list of at least one value, found []"),
        ({"a": np.array(1)}, "a: expected a list of at least one value, found 1"),
        ({"a": "1"}, "a: expected a list of at least one value, found '1'"),
        ({"a": range(MAX_LEVELS), "b": [1, 2]}, f"{2 * MAX_LEVELS} choices of values; at most {MAX_LEVELS}"),
    ],
)
def test_values_that_make_no_levels_are_refused(values: dict[str, list[object]], says: str) -> None:
    with pytest.raises(SceneError) as refused:
        levels(values)
    assert says in str(refused.value)


def test_values_may_be_an_array() -> None:
    assert levels({"a": np.linspace(0.01, 0.03, 2)}) == [{"a": "0.01"}, {"a": "0.03"}]


def test_what_names_no_scene_and_no_key_is_refused() -> None:
    """As a notebook may give it, whose author no type checker has warned."""
    loaded: Any = load_scene("close_range")
    with pytest.raises(TypeError, match="name of a scene or the path of its file, found a Scene"):
        run_variation(loaded, {LATENCY: [20]}, [0])
    no_mapping: Any = [LATENCY]
    for values in ({}, no_mapping):
        with pytest.raises(SceneError, match="expected the values of at least one dotted key as a dict"):
            run_variation("close_range", values, [0])


def test_a_scene_that_a_level_makes_unusable_is_refused_with_its_values() -> None:
    with pytest.raises(SceneError, match=r"with radio=\{\}: .*cameras.overhead"):
        load_levels("close_range", levels({"radio": [None, {}]}), varied_as="--vary")
    with pytest.raises(SceneError, match=r"^--vary nosuch=1: "):
        load_levels("close_range", levels({"nosuch": [1]}), {CONTROLLER: "c1"}, varied_as="--vary")


def test_every_level_is_the_scene_with_its_values_and_those_that_all_share() -> None:
    scenes = load_levels("close_range", levels({LATENCY: [20, 60]}), {CONTROLLER: "linear"})
    assert scenes == [load_scene("close_range", {LATENCY: ms, CONTROLLER: "linear"}) for ms in (20, 60)]


def test_a_value_within_another_one_holds_at_every_level() -> None:
    noise, yaw = ("parametric.sigma_xy_m", "parametric.sigma_yaw_deg")
    same = {"perception": "parametric", noise: 0.01}
    scenes = load_levels("close_range", levels({"parametric": [{}, {"sigma_yaw_deg": 2}]}), same)
    assert scenes == [load_scene("close_range", {**same, **yaws}) for yaws in ({}, {yaw: 2})]


def test_levels_that_are_the_same_scene_and_keys_with_two_values_are_refused() -> None:
    with pytest.raises(SceneError, match=f"{LATENCY}=60 and {LATENCY}=60.0 are the same scene"):
        load_levels("close_range", levels({LATENCY: [60, 60.0]}))
    with pytest.raises(SceneError, match=f"{LATENCY} is varied, and override sets it to one value"):
        load_levels("close_range", levels({LATENCY: [20, 60]}), {LATENCY: 30})


def test_the_summary_of_a_level_is_that_of_a_sweep_at_its_values(varied: Variation) -> None:
    for level in varied.levels:
        alone = run_sweep(load_scene("close_range", level.values), range(8), executor=inline, trial=made_up)
        assert level.summary == alone
    assert Variation.model_validate_json(varied.to_json()) == varied


def test_every_level_counts_what_it_has_from_the_store(tmp_path: Path) -> None:
    store = tmp_path / "trials.sqlite"
    run_sweep(load_scene("close_range", {LATENCY: 20}), range(3), store=store, executor=inline, trial=made_up)
    found = run_variation(
        "close_range", {LATENCY: [20, 90]}, range(5), store=store, executor=inline, trial=made_up
    )
    assert [level.summary.reused for level in found.levels] == [3, 0]


def test_the_table_has_a_row_for_every_level_and_every_step(varied: Variation) -> None:
    assert varied.title == f"close_range (bullet, images) at 6 combinations of {LATENCY} and {CONTROLLER}"
    assert varied.head()[:4] == ["latency_ms", "docking", "docked", "lateral error,\nmedian [mm]"]
    interval = "67.6 .. 100.0"
    assert [row[:3] for row in varied.rows()] == [
        [(ms, ""), (law, ""), ("8 of 8", interval)]
        for ms in ("20", "60.0", "120")
        for law in ("c1", "linear")
    ]
    two = run_variation("three_units", {LATENCY: [20, 60]}, range(2), executor=inline, trial=made_up)
    assert [(row[0][0], row[2][0]) for row in two.rows()] == [
        ("20", "a to b.rear"),
        ("", "c to a.rear"),
        ("60", "a to b.rear"),
        ("", "c to a.rear"),
    ]
    assert f"8 of 8 ({interval})" in varied._repr_html_()


def test_columns_of_keys_with_the_same_last_name_have_different_titles() -> None:
    keys = (LATENCY, "cameras.overhead.latency_ms", CONTROLLER)
    values = dict(zip(keys, ([20], [30], ["c1"]), strict=True))
    found = run_variation("three_units", values, [0], executor=inline, trial=made_up)
    assert found.head()[:3] == ["onboard.latency_ms", "overhead.latency_ms", "docking"]


@pytest.fixture(scope="module")
def plans() -> Variation:
    """One docking step, two, and a mission."""
    choices = [
        {"plan": "[{unit: a, to: b.rear}]"},
        {"plan": "[{unit: c, to: b.rear}, {unit: a, to: c.rear}]"},
        {"plan": "[]", "shape": "{line: 3}"},
    ]
    summaries = [
        run_sweep(load_scene("three_units", choice), [0, 1], executor=inline, trial=made_up)
        for choice in choices
    ]
    return Variation.of([{"plan": choice["plan"]} for choice in choices], summaries)


def test_levels_may_have_different_steps(plans: Variation, drawn: list[Figure]) -> None:
    steps = ["a to b.rear", "c to b.rear", "a to c.rear", "all docking steps"]
    assert plans.steps == steps
    assert plans.head()[1:4] == ["docked or complete", "last lock [s]", "step"]
    assert {len(row) for row in plans.rows()} == {len(plans.head())}
    assert [row[3][0] for row in plans.rows()] == steps
    plot_variation(plans, "plot.png")
    rates, *errors = drawn[0].axes
    assert rates.get_ylabel() == "share of trials\ndocked or complete"
    assert [axes.get_title() for axes in errors] == steps
    known = [np.isfinite(np.asarray(axes.containers[0].lines[0].get_ydata(), dtype=float)) for axes in errors]
    assert [list(found) for found in known[:2]] == [[True, False, False], [False, True, False]]


def test_the_title_names_what_differs_between_levels() -> None:
    values = {"plant": ["unicycle", "bullet"]}
    found = run_variation("close_range", values, [0], executor=inline, trial=made_up)
    assert found.title.startswith("close_range (unicycle and bullet, images) at 2 values")


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that were drawn, in the place of files."""
    figures: list[Figure] = []

    def keep(figure: Figure, path: Path) -> Path:
        figures.append(figure)
        return path

    monkeypatch.setattr(variation_plot, "save", keep)
    return figures


def test_the_plot_shows_rate_and_errors_of_every_level(varied: Variation, drawn: list[Figure]) -> None:
    """One curve for each controller, with points at the values, beside each other by less than a tick."""
    plot_variation(varied, "plot.png")
    rates, errors = drawn[0].axes
    curves = [container.lines[0] for container in rates.containers]
    assert [container.get_label() for container in rates.containers] == [
        f"{CONTROLLER}=c1",
        f"{CONTROLLER}=linear",
    ]
    for curve in curves:
        np.testing.assert_allclose(np.asarray(curve.get_xdata(), dtype=float), [20, 60, 120], atol=2.0)
        np.testing.assert_array_equal(curve.get_ydata(), 1.0)
    assert not np.array_equal(curves[0].get_xdata(), curves[1].get_xdata())
    medians, tails, *_ = (container.lines[0].get_ydata() for container in errors.containers)
    step = varied.levels[0].summary.steps[0]
    np.testing.assert_allclose(np.asarray(medians, dtype=float), step.contact_lateral_mm.p50)
    np.testing.assert_allclose(np.asarray(tails, dtype=float), step.contact_lateral_mm.p95)
    assert errors.get_xlabel() == LATENCY


@pytest.mark.parametrize(
    ("values", "scale", "ticks"),
    [
        ([10, 30, 400], "log", ["10", "30", "400"]),
        ([30, 100, 400], "linear", ["30", "100", "400"]),
        ([100, 30, 31, 400], "linear", ["30", "100", "400"]),
        ([30], "linear", ["30"]),
        (["perfect", "careful"], "linear", ["perfect", "careful"]),
    ],
)
def test_the_axis_suits_the_values(
    values: list[object], scale: str, ticks: list[str], drawn: list[Figure]
) -> None:
    key = "as_built" if isinstance(values[0], str) else LATENCY
    plot_variation(
        run_variation("close_range", {key: values}, [0], executor=inline, trial=made_up), "plot.png"
    )
    axes = drawn[0].axes[1]
    assert axes.get_xscale() == scale
    labels = [label.get_text() for label in axes.get_xticklabels()]
    assert labels == ticks
    if scale == "log" or values != labels:
        np.testing.assert_allclose(axes.get_xticks(), [float(label) for label in labels])


def test_a_level_without_a_trial_has_no_rate_in_the_plot(varied: Variation, drawn: list[Figure]) -> None:
    first, *others = (level for level in varied.levels if level.values[CONTROLLER] == "c1")
    summary = first.summary.model_copy(update={"trials": 0, "success": wilson(0, 0)})
    plot_variation(Variation(levels=(first.model_copy(update={"summary": summary}), *others)), "plot.png")
    rates = np.asarray(drawn[0].axes[0].containers[0].lines[0].get_ydata(), dtype=float)
    np.testing.assert_array_equal(rates, [np.nan, 1.0, 1.0])


def test_where_no_pin_touched_the_plot_says_so(varied: Variation, drawn: list[Figure]) -> None:
    """It had an axis of millimetres without a point, which reads as if errors were too small to see."""
    none = []
    for level in varied.levels:
        steps = tuple(step.model_copy(update={"contact_lateral_mm": None}) for step in level.summary.steps)
        summary = level.summary.model_copy(update={"steps": steps})
        none.append(level.model_copy(update={"summary": summary}))
    plot_variation(Variation(levels=tuple(none)), "plot.png")
    for axes in drawn[0].axes[1:]:
        assert [text.get_text() for text in axes.texts] == ["no contact"]
        assert len(axes.get_yticks()) == 0


def test_a_curve_goes_through_its_values_in_their_order(varied: Variation, drawn: list[Figure]) -> None:
    plot_variation(Variation(levels=varied.levels[::-1]), "plot.png")
    for container in drawn[0].axes[0].containers:
        assert np.all(np.diff(np.asarray(container.lines[0].get_xdata(), dtype=float)) > 0.0)


@pytest.mark.parametrize(
    "values",
    [
        np.geomspace(1, 200, 60).round(2),
        np.linspace(-100, 200, 60).round(2),
        [f"{{name: c1, params: {{gain: {i}, slow_down: true}}}}" for i in range(3)],
        [f"a rather long name {i}" for i in range(12)],
        [f"name {i}" for i in range(100)],
    ],
)
def test_no_label_covers_another_one_or_a_curve(
    values: list[object], varied: Variation, drawn: list[Figure]
) -> None:
    level = varied.levels[0]
    found = [level.model_copy(update={"values": {"a.key": str(value)}}) for value in values]
    plot_variation(Variation(levels=tuple(found)), "plot.png")
    figure, axes = drawn[0], drawn[0].axes[-1]
    with styled():
        figure.draw_without_rendering()
    boxes = [label.get_window_extent() for label in axes.get_xticklabels() if label.get_text()]
    assert len(boxes) > 2
    assert all(left.x1 < right.x0 for left, right in pairwise(boxes))
    legend = axes.get_legend()
    assert legend is not None
    tail = axes.transData.transform((0.0, level.summary.steps[0].contact_lateral_mm.p95))[1]
    assert tail < legend.get_window_extent().y0


def test_a_plot_that_could_not_be_read_or_written_is_refused_before_the_trials() -> None:
    check_plot(levels({"a": range(100), "b": range(7)}), Path("plot.svg"))
    with pytest.raises(SceneError, match="8 curves, one for each choice of the later keys; at most 7"):
        check_plot(levels({"a": range(2), "b": range(8)}), Path("plot.svg"))
    with pytest.raises(MsrrError, match=r"no format for plots; end the name with \.png"):
        check_plot([{"a": "1"}], Path("plot.gif"))


def test_the_same_variation_gives_the_same_file(varied: Variation, tmp_path: Path) -> None:
    first, second = (plot_variation(varied, tmp_path / name) for name in ("a.png", "b.png"))
    assert first.read_bytes() == second.read_bytes()
