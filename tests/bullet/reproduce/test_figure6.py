"""The paper's Fig. 6: C1 and C2 from the same start, with their references before and after correction."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from msrr_bullet.reproduce.figure6 import bullet_figure6, unicycle_figure6
from msrr_bullet.reproduce.report.figure6_plot import draw_figure6
from msrr_bullet.studies.gain_delay import C1, PAPER_LIKE
from msrr_bullet.studies.labels import C2
from msrr_bullet.studies.series import Figure6


def check(figure: Figure6) -> None:
    c1, c2 = (figure.series[label] for label in (C1, C2))
    assert list(figure.series) == [C1, C2]
    np.testing.assert_allclose(c1.tip[0], c2.tip[0], atol=1e-3)  # one start
    for series in (c1, c2):
        lengths = {len(getattr(series, name)) for name in ("time", "tip", "reference", "corrected", "twist")}
        assert lengths == {len(series.command)}
        assert np.all(np.array(series.reference)[:, 1] == 0.0)
    # High gain and delay: C2 swings to and fro, and the line of sight moves its reference.
    turns = [np.sum(np.diff(np.sign(np.array(s.twist)[:, 1])) != 0) for s in (c1, c2)]
    assert turns[1] >= 4
    assert np.ptp([y for _, y in c2.corrected]) > 0.01
    late = [np.abs(np.array(s.tip)[len(s.tip) // 2 :, 1]).max() for s in (c1, c2)]
    assert late[1] > 2.0 * late[0]


@pytest.fixture(scope="module")
def of_unicycles() -> Figure6:
    return unicycle_figure6(0, PAPER_LIKE)


def test_both_laws_stand_over_each_other(
    of_unicycles: Figure6, blind_loop: dict[str, str], tmp_path: Path
) -> None:
    figures = (of_unicycles, bullet_figure6(0, PAPER_LIKE, blind_loop))
    for figure in figures:
        check(figure)
    assert figures[0].description.startswith("gain 8 1/s, ")
    assert unicycle_figure6(0, (6.0, 0.1)).description.startswith("gain 6 1/s, ")
    assert [f.plant for f in figures] == ["unicycle", "bullet"]
    assert draw_figure6(figures, tmp_path / "figure6.png").stat().st_size > 50_000


@pytest.mark.parametrize("plants", [1, 2])
def test_the_legend_is_whole(
    plants: int, of_unicycles: Figure6, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of unicycles alone it was wider than the sheet, and cut off at both sides."""
    inside: list[bool] = []

    def look(sheet: Figure, path: Path) -> Path:
        sheet.draw_without_rendering()
        (legend,) = sheet.legends
        box = legend.get_window_extent()
        inside.append(sheet.bbox.x0 <= box.x0 < box.x1 <= sheet.bbox.x1)
        return path

    monkeypatch.setattr("msrr_bullet.reproduce.report.figure6_plot.save", look)
    draw_figure6([of_unicycles] * plants, tmp_path / "figure6.png")
    assert inside == [True]


@pytest.mark.nightly
def test_both_laws_in_the_real_loop() -> None:
    check(bullet_figure6(0, PAPER_LIKE))
