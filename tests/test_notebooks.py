"""The notebooks run, and what they end with shows itself: tables, pictures, pages."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from msrr_bullet.run import run_trial
from msrr_bullet.run_folder import PICTURE_NAME, REPLAY_NAME
from msrr_bullet.sweep.summarise import summarise
from tests.conftest import ShippedScene

NOTEBOOKS = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.ipynb"))


def code(notebook: Path) -> list[dict[str, Any]]:
    return [cell for cell in json.loads(notebook.read_text())["cells"] if cell["cell_type"] == "code"]


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_python_and_stored_without_outputs(notebook: Path) -> None:
    cells = code(notebook)
    assert cells
    for cell in cells:
        assert not cell["outputs"]
        assert cell["execution_count"] is None
        ast.parse("".join(line for line in cell["source"] if not line.startswith("%%")))


@pytest.mark.nightly
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(notebook: Path, tmp_path: Path) -> None:
    """In a kernel of its own, as in Jupyter; a cell that fails raises here."""
    import nbformat
    from nbclient import NotebookClient

    client = NotebookClient(nbformat.read(notebook, as_version=4), timeout=240, kernel_name="python3")
    done = client.execute(cwd=str(tmp_path))
    shown = [set(out.get("data", {})) for cell in done.cells for out in cell.get("outputs", [])]
    assert any("text/html" in kinds for kinds in shown)


def test_results_and_scenes_show_themselves(shipped: ShippedScene, tmp_path: Path) -> None:
    scene = shipped("close_range", {"description": "<b>near</b>"}, blind=True)
    stored = run_trial(scene, 1)
    assert stored.folder is None
    cv2.imwrite(str(tmp_path / PICTURE_NAME), np.zeros((2, 2), np.uint8))
    (tmp_path / REPLAY_NAME).write_text('<!DOCTYPE html><p class="run">')
    result = stored.model_copy(update={"folder": tmp_path})
    assert result == stored
    assert result.to_json() == stored.to_json()
    shown = result._repr_html_()
    assert "docked" in shown
    assert f"{1000 * result.steps[0].contact.lateral_m:.2f} mm" in shown
    assert 'src="data:image/png;base64,iVBOR' in shown
    assert 'srcdoc="&lt;!DOCTYPE html&gt;&lt;p class=&quot;run&quot;&gt;"' in shown
    assert "<img" not in stored._repr_html_()
    sweep = summarise(scene, "", [result])._repr_html_()
    assert "100.0 % succeed" in sweep
    assert "lateral error at first contact" in sweep
    assert "&lt;b&gt;near" in scene._repr_html_()
    assert "(-0.7, 0) m, 0 deg in b.rear" in scene._repr_html_()
