"""The fingerprint of the code covers what a scene names by import path."""

import importlib
import sys
from pathlib import Path
from types import ModuleType

import pytest

from msrr_bullet.sweep.provenance import code_fingerprint
from msrr_bullet.sweep.sweep import run_sweep
from msrr_bullet.sweep.trials import run_trials
from msrr_bullet.trial.check import check_trial
from msrr_scenes import load_scene
from msrr_scenes.errors import ChangedFileError, SceneError
from msrr_scenes.own_modules import import_own
from msrr_scenes.specs.scene import Scene
from tests.bullet.sweep.conftest import inline


def test_the_code_of_an_own_controller_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = tmp_path / "own_law.py"
    module.write_text("class Law: ...\n")
    monkeypatch.syspath_prepend(tmp_path)
    scene = load_scene("close_range", {"control.docking": "own_law:Law"})
    before = code_fingerprint(scene)
    assert code_fingerprint(scene) == before
    module.write_text("class Law: gain = 2\n")
    assert code_fingerprint(scene) != before


def test_a_process_that_lives_on_runs_the_code_that_it_has_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = tmp_path / "edited_law.py"
    module.write_text("class Law: ...\n")
    monkeypatch.syspath_prepend(tmp_path)
    scene = load_scene("close_range", {"control.docking": "edited_law:Law"})
    import_own("edited_law")
    before = code_fingerprint(scene, imported=True)
    assert before == code_fingerprint(scene)
    module.write_text("class Law: gain = 2\n")
    assert code_fingerprint(scene, imported=True) == before
    assert code_fingerprint(scene) != before
    with pytest.raises(ChangedFileError, match=r"edited_law:Law.*edited"):
        check_trial(scene)


def test_what_it_imports_from_its_folder_counts_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {
        "gains.py": "GAIN = 1\n",
        "laws/__init__.py": "",
        "laws/base.py": "import numpy\nfrom . import limits\nfrom .deep.table import ROWS\n",
        "laws/limits.py": "LIMIT = 1\n",
        "laws/deep/__init__.py": "",
        "laws/deep/table.py": "import gains, no_such_module\nROWS = ()\n",
        "laws/own.py": "from laws import base\nclass Law: ...\n",
        "laws/unused.py": "",
        "numpy.py": "raise RuntimeError('never run: it only stands in the folder')\n",
        "unused.py": "",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    scene = load_scene("close_range", {"control.docking": "laws.own:Law"})
    for name, text in files.items():
        before = code_fingerprint(scene)
        (tmp_path / name).write_text(text + "# changed\n")
        assert (code_fingerprint(scene) != before) is ("unused" not in name), name
    (tmp_path / "gains.py").write_text("GAIN = (\n")
    assert code_fingerprint(scene) == code_fingerprint(scene)  # the trial reports the mistake


def test_a_store_refuses_a_class_that_has_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As one of a cell of a notebook: its results would have been taken for those of an edited one."""
    cell = ModuleType("__main__")
    cell.__dict__["Law"] = object
    monkeypatch.setitem(sys.modules, "__main__", cell)
    scene = load_scene("close_range", {"control.docking": "__main__:Law"})
    with pytest.raises(SceneError, match=r"class of '__main__' has no file.*write it to a file, or"):
        run_trials([(scene, [0])], store=tmp_path / "s.sqlite")


def test_results_by_an_edited_trial_function_are_not_those_of_the_new_one(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The store has the result of the older one; each program imports its own."""
    text = """
from tests.bullet.sweep.conftest import made_up

def trial(scene, seed):
    return made_up(scene, {})
"""
    monkeypatch.syspath_prepend(tmp_path)
    reused = []
    for seed in ("seed", "seed", "seed + 0"):
        (tmp_path / "own_trial.py").write_text(text.format(seed))
        monkeypatch.delitem(sys.modules, "own_trial", raising=False)
        importlib.invalidate_caches()
        trial = importlib.import_module("own_trial").trial
        summary = run_sweep(scene, range(2), store=tmp_path / "s.sqlite", executor=inline, trial=trial)
        reused.append(summary.reused)
    assert reused == [0, 2, 0]
