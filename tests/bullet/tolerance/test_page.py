"""The page of a study: whole in one file, with every effect, in both tables and both colours."""

import base64
from collections.abc import Sequence
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest

from msrr_bullet.tolerance.error_budget import contributions
from msrr_bullet.tolerance.model import SizeSample, ToleranceStudy
from msrr_bullet.tolerance.page import write_study
from msrr_bullet.tolerance.wording import beyond, findings, first_cells, grade_cells, listed, percent


class Page(HTMLParser):
    """The tags of a page with their attributes, and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words = ""
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.words += data


@pytest.fixture(scope="module")
def folder(study: ToleranceStudy, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    assert write_study(study, folder) == folder / "tolerance.html"
    return folder


def test_the_page_needs_nothing_but_itself(folder: Path) -> None:
    page = Page((folder / "tolerance.html").read_text())
    links = [a[key] or "" for _, a in page.tags for key in ("src", "href", "srcset") if key in a]
    assert len(links) == 2
    for link in links:
        kind, data = link.split(",", 1)
        assert kind == "data:image/png;base64"
        assert cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR) is not None
    assert "url(" not in (folder / "tolerance.html").read_text()


def test_the_page_tells_what_was_studied(study: ToleranceStudy, tmp_path: Path) -> None:
    """Two studies of one scene with other values looked alike."""
    write_study(study.model_copy(update={"overrides": {"cameras.onboard.noise_grey": "8"}}), tmp_path)
    words = " ".join(Page((tmp_path / "tolerance.html").read_text()).words.split())
    said = f"({study.scene_hash[:6]}), plant {study.plant}, perception {study.perception}"
    assert f"{said}, --set cameras.onboard.noise_grey=8." in words


def test_the_page_shows_every_effect_and_grade(folder: Path, study: ToleranceStudy) -> None:
    page = Page((folder / "tolerance.html").read_text())
    for name in [e.name for e in study.effects] + [g.grade for g in study.grades]:
        assert name in page.words
    assert sum(tag == "tr" for tag, _ in page.tags) == 3 + len(study.grades) + 2 * len(study.effects)
    labels = [a.get("data-label") for tag, a in page.tags if tag == "td"]
    assert all(labels)  # on a narrow page, on which the heads are hidden, each cell says what it is


@pytest.mark.parametrize(
    ("share", "said"), [(0.0, "0 %"), (0.0002, "below 0.1 %"), (0.0234, "2.3 %"), (0.234, "23 %")]
)
def test_a_share_is_zero_only_if_it_is_none(share: float, said: str) -> None:
    assert percent(share) == said


@pytest.mark.parametrize(
    ("seeds", "said"), [(range(3, 7), "3 to 6"), ((1, 5, 9), "1, 5, 9"), ((7,), "7"), ((3, 2, 1), "3, 2, 1")]
)
def test_seeds_are_said_as_they_are(seeds: Sequence[int], said: str) -> None:
    assert listed(seeds) == said


def test_some_effects_are_not_added_up_to_a_grade(study: ToleranceStudy, tmp_path: Path) -> None:
    """A robot of a grade has the errors of the others as well."""
    whole, part = (study.model_copy(update={"all_graded": all_graded}) for all_graded in (True, False))
    found = contributions(study)
    (tmp_path / "page").mkdir()
    for some, predicts in ((whole, True), (part, False)):
        write_study(some, tmp_path / "page")
        page = " ".join((tmp_path / "page" / "tolerance.html").read_text().split())
        assert ("effects act on each other" in page) == predicts
        said = " ".join(findings(some, found))
        assert (
            "Of the effects tried, the largest shares in what is used up of docking's tolerance" in said
        ) != predicts
        assert ("nothing is predicted for a grade" in said) != predicts
        *_, rms, docked, _ = grade_cells(some.grades[1], found, some.all_graded)
        assert ("(" in rms) == ("%" in docked) == predicts


def test_what_was_not_found_is_no_zero(study: ToleranceStudy) -> None:
    """An effect without a limit may have one beyond what was tried; without a contact there is no error."""
    yaw, wheel, track = (first_cells(contribution) for contribution in contributions(study))
    assert yaw[3] == "100 %"
    assert wheel[3] == track[3] == "no limit found"
    assert (float(wheel[4]) > 0.0, wheel[5].endswith("%"), track[5]) == (True, True, "0 %")
    untouched = study.effects[0].model_copy(update={"lateral": None, "yaw": None})
    (cells,) = map(first_cells, contributions(study.model_copy(update={"effects": (untouched,)})))
    assert cells[4:] == ["-", "-"]


def test_the_json_is_the_study(folder: Path, study: ToleranceStudy) -> None:
    assert ToleranceStudy.model_validate_json((folder / "tolerance.json").read_text()) == study


def test_the_dark_figure_is_dark(folder: Path) -> None:
    light, dark = (cv2.imread(str(folder / name)) for name in ("tornado.png", "tornado-dark.png"))
    assert light is not None
    assert dark is not None
    assert light.shape == dark.shape
    assert light.mean() > 200.0
    assert dark.mean() < 80.0


def test_a_size_that_is_too_large_with_one_sign_only_says_which(study: ToleranceStudy) -> None:
    yaw = next(effect for effect in study.effects if effect.name == "onboard.yaw_deg")
    assert yaw.fails is not None
    assert beyond(yaw) == "2 false_abort"
    sample = yaw.sample(yaw.fails)
    with_plus = [t.model_copy(update={"succeeded": (t.error or 0.0) > 0.0}) for t in sample.trials]
    samples = tuple(
        SizeSample.of(with_plus, size=sample.size, holds=False) if s is sample else s for s in yaw.samples
    )
    assert beyond(yaw.model_copy(update={"samples": samples})).endswith(", only with -")
