"""Sweeps of one scene at several values of its keys: the levels, their summaries, and the plot of them."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from msrr_bullet.sweep import variation_plot
from msrr_bullet.sweep.sweep import run_sweep
from msrr_bullet.sweep.variation import MAX_LEVELS, Variation, levels, load_levels, run_variation
from msrr_bullet.sweep.variation_plot import check_plot, plot_variation
from msrr_bullet.sweep.worker_pool import SupportsSubmit, TrialFunction
from msrr_scenes import load_scene
from msrr_scenes.errors import MsrrError, SceneError

LATENCY, CONTROLLER = "cameras.onboard.latency_ms", "control.docking"


@pytest.fixture(scope="module")
def varied(inline: SupportsSubmit, made_up: TrialFunction) -> Variation:
    values = {LATENCY: [20, 60.0, "120"], CONTROLLER: ["c1", "linear"]}
    return run_variation("close_range", values, range(8), executor=inline, trial=made_up)


def test_levels_are_all_combinations_and_the_last_key_varies_fastest() -> None:
    found = levels({"a": [0, "1e-3"], "b": [[1, 2], True, {"name": "c1"}]})
    assert found == [{"a": a, "b": b} for a in ("0", "1e-3") for b in ("[1, 2]", "true", "{name: c1}")]
    assert levels({}) == [{}]


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"a": []}, "a: expected a list of at least one value, found []"),
        ({"a": "1"}, "a: expected a list of at least one value, found '1'"),
        ({"a": range(MAX_LEVELS), "b": [1, 2]}, f"{2 * MAX_LEVELS} choices of values; at most {MAX_LEVELS}"),
    ],
)
def test_values_that_make_no_levels_are_refused(values: dict[str, list[object]], says: str) -> None:
    with pytest.raises(SceneError) as refused:
        levels(values)
    assert says in str(refused.value)


def test_a_scene_that_a_level_makes_unusable_is_refused_with_its_values() -> None:
    with pytest.raises(SceneError, match=r"with radio=\{\}: .*cameras.overhead"):
        load_levels("close_range", levels({"radio": [None, {}]}), varied_as="--vary")
    with pytest.raises(SceneError, match=r"^--vary nosuch=1: "):
        load_levels("close_range", levels({"nosuch": [1]}), {CONTROLLER: "c1"}, varied_as="--vary")


def test_every_level_is_the_scene_with_its_values_and_those_that_all_share() -> None:
    scenes = load_levels("close_range", levels({LATENCY: [20, 60]}), {CONTROLLER: "linear"})
    assert scenes == [load_scene("close_range", {LATENCY: ms, CONTROLLER: "linear"}) for ms in (20, 60)]


def test_levels_that_are_the_same_scene_and_keys_with_two_values_are_refused() -> None:
    with pytest.raises(SceneError, match=f"{LATENCY}=60 and {LATENCY}=60.0 are the same scene"):
        load_levels("close_range", levels({LATENCY: [60, 60.0]}))
    with pytest.raises(SceneError, match=f"{LATENCY} is varied, and override sets it to one value"):
        load_levels("close_range", levels({LATENCY: [20, 60]}), {LATENCY: 30})


def test_the_summary_of_a_level_is_that_of_a_sweep_at_its_values(
    varied: Variation, inline: SupportsSubmit, made_up: TrialFunction
) -> None:
    for level in varied.levels:
        alone = run_sweep(load_scene("close_range", level.values), range(8), executor=inline, trial=made_up)
        assert level.summary == alone
    assert Variation.model_validate_json(varied.to_json()) == varied


def test_every_level_counts_what_it_has_from_the_store(
    tmp_path: Path, inline: SupportsSubmit, made_up: TrialFunction
) -> None:
    store = tmp_path / "trials.sqlite"
    run_sweep(load_scene("close_range", {LATENCY: 20}), range(3), store=store, executor=inline, trial=made_up)
    found = run_variation(
        "close_range", {LATENCY: [20, 90]}, range(5), store=store, executor=inline, trial=made_up
    )
    assert [level.summary.reused for level in found.levels] == [3, 0]


def test_the_table_has_a_row_for_every_level_and_every_step(
    varied: Variation, inline: SupportsSubmit, made_up: TrialFunction
) -> None:
    assert varied.title == f"close_range (bullet, images) at 6 values of {LATENCY} and {CONTROLLER}"
    assert varied.head()[:4] == ["latency_ms", "docking", "docked", "lateral error [mm], median"]
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
        ([30, 100, 400], "linear", None),
        (["perfect", "careful"], "linear", ["perfect", "careful"]),
    ],
)
def test_the_axis_suits_the_values(
    values: list[object],
    scale: str,
    ticks: list[str] | None,
    inline: SupportsSubmit,
    made_up: TrialFunction,
    drawn: list[Figure],
) -> None:
    key = "as_built" if isinstance(values[0], str) else LATENCY
    plot_variation(
        run_variation("close_range", {key: values}, [0], executor=inline, trial=made_up), "plot.png"
    )
    axes = drawn[0].axes[1]
    assert axes.get_xscale() == scale
    labels = [label.get_text() for label in axes.get_xticklabels()]
    assert ticks is None or labels == ticks


def test_a_plot_that_could_not_be_read_or_written_is_refused_before_the_trials() -> None:
    check_plot(levels({"a": range(100), "b": range(7)}), Path("plot.svg"))
    with pytest.raises(SceneError, match="8 curves, one for each choice of the later keys; at most 7"):
        check_plot(levels({"a": range(2), "b": range(8)}), Path("plot.svg"))
    with pytest.raises(MsrrError, match=r"no format for plots; end the name with \.png"):
        check_plot([{"a": "1"}], Path("plot.gif"))


def test_the_same_variation_gives_the_same_file(varied: Variation, tmp_path: Path) -> None:
    first, second = (plot_variation(varied, tmp_path / name) for name in ("a.png", "b.png"))
    assert first.read_bytes() == second.read_bytes()
