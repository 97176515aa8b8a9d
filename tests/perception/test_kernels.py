"""Where compiled code is kept, and what the kernels say where numpy says it more slowly."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from msrr_perception.kernels import compiled, warm
from msrr_perception.kernels.compiled import KernelCompiler
from msrr_perception.kernels.fit import gate_distances
from msrr_perception.kernels.project import expect
from msrr_perception.pose.corner_fit import Corners, fit_corners
from msrr_perception.pose.tag_camera import project, project_with_jacobian
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.se2 import SE2

FolderOf = Callable[..., Path]
SOURCES = Path(compiled.__file__).parent


@pytest.fixture
def folder_of(monkeypatch: pytest.MonkeyPatch) -> FolderOf:
    def find(sources: Path = SOURCES, **environment: str) -> Path:
        for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME", "TMPDIR"):
            monkeypatch.delenv(name, raising=False)
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        monkeypatch.setattr("tempfile.tempdir", environment.get("TMPDIR"))
        return KernelCompiler(sources).folder

    return find


def test_the_folder_of_compiled_code_is_the_users(folder_of: FolderOf, tmp_path: Path) -> None:
    given, cache, home, temporary = (tmp_path / n for n in ("given", "cache", "home", "tmp"))
    blocked = tmp_path / "file"
    blocked.write_text("")
    temporary.mkdir()
    assert folder_of(NUMBA_CACHE_DIR=str(given), HOME=str(home)).parent == given
    assert folder_of(XDG_CACHE_HOME=str(cache), HOME=str(home)).parent == cache / "msrr-bullet"
    assert folder_of(HOME=str(home)).parent == home / ".cache" / "msrr-bullet"
    fallback = folder_of(XDG_CACHE_HOME=str(blocked), TMPDIR=str(temporary))
    assert fallback.parent == temporary / f"msrr-bullet-{os.getuid()}"
    # Nobody else may put code there for us to run.
    assert fallback.stat().st_mode & 0o077 == 0
    fallback.chmod(0o777)
    private = folder_of(XDG_CACHE_HOME=str(blocked), TMPDIR=str(temporary))
    assert private.parent == temporary
    assert private.stat().st_mode & 0o077 == 0


def test_an_edited_kernel_is_compiled_anew(folder_of: FolderOf, tmp_path: Path) -> None:
    before = folder_of(NUMBA_CACHE_DIR=str(tmp_path))
    copy = tmp_path / "sources"
    copy.mkdir()
    for source in SOURCES.glob("*.py"):
        (copy / source.name).write_bytes(source.read_bytes())
    assert folder_of(copy, NUMBA_CACHE_DIR=str(tmp_path)) == before
    with (copy / "edges.py").open("a") as file:
        file.write("# edited\n")
    assert folder_of(copy, NUMBA_CACHE_DIR=str(tmp_path)) != before


def test_ready_code_is_not_announced() -> None:
    warm.warm()
    said: list[str] = []
    warm.warm(said.append)
    assert said == []


def _some(target: TargetModel, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return a pose with tilt, and the corners of the tags of the port, as drawn by ``rng``."""
    pose = np.array([rng.uniform(-0.8, -0.2), *rng.normal(0.0, [0.03, 0.05, 0.005, 0.005])])
    return pose, np.concatenate([target.corners_D[tag] for tag in target.port_tags])


def test_a_fit_ends_where_the_gradient_vanishes(target: TargetModel) -> None:
    """Gradient and covariance are worked out by numpy from the projection and its derivatives."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        pose, points = _some(target, rng)
        pixels = project(target, pose, points)[1].reshape(-1) + rng.normal(0.0, 0.2, 2 * len(points))
        prior = np.diag([1e2, 1e2, 1e2, 4e4, 4e4])
        found = fit_corners(
            target, Corners(points, pixels, 0.25), pose + 0.01, pose, prior, max_iterations=30
        )
        assert found.converged
        predicted, J = project_with_jacobian(target, found.state, points)
        residual = (pixels - predicted) / 0.25
        H = J.T @ J / 0.25**2 + prior
        gradient = J.T @ residual / 0.25 - prior @ (found.state - pose)
        step = np.linalg.solve(H, gradient)
        assert float(step @ H @ step) < 1e-5
        assert found.chi2 == pytest.approx(float(residual @ residual), rel=1e-9)
        np.testing.assert_allclose(found.covariance @ H, np.eye(5), atol=1e-6)


def test_a_direction_left_open_is_an_error(target: TargetModel) -> None:
    pose, points = _some(target, np.random.default_rng(1))
    pixels = project(target, pose, points)[1].reshape(-1)
    with pytest.raises(np.linalg.LinAlgError, match="open"):
        fit_corners(
            target,
            Corners(points, pixels, 0.25),
            np.append(pose, [0.0, 0.0]),
            np.zeros(7),
            np.zeros((7, 7)),  # the last two entries do not show in the image, and nothing else holds them
        )


def test_the_gate_measures_mahalanobis_distances(target: TargetModel) -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        pose, points = _some(target, rng)
        A = rng.normal(0.0, 0.003, (7, 7))
        P, state = A @ A.T, np.append(pose, [0.01, -0.01])
        predicted, J = project_with_jacobian(target, pose, points)
        pixels = predicted + rng.normal(0.0, 1.0, len(predicted))
        found = gate_distances(target.optics, points, pixels, 0.25, state, P)
        for tag in range(len(found)):
            rows = slice(8 * tag, 8 * tag + 8)
            S = J[rows] @ P[:5, :5] @ J[rows].T + 0.25**2 * np.eye(8)
            r = (pixels - predicted)[rows]
            assert found[tag] == pytest.approx(float(r @ np.linalg.solve(S, r)), rel=1e-6)


def test_tags_are_expected_where_they_can_be_read(target: TargetModel) -> None:
    rng, camera = np.random.default_rng(3), target.camera
    counts = {True: 0, False: 0}
    for _ in range(200):
        X_DU = SE2(rng.uniform(-0.9, 0.1), rng.normal(0.0, 0.15), rng.normal(0.0, 0.4))
        pose = np.append(X_DU.as_array(), [0.0, 0.0])
        A = rng.normal(0.0, 0.01, (3, 3))
        pixels, sigma, expected = expect(
            target.optics, camera.width, camera.height, pose, A @ A.T, target.all_corners_D, 10.0
        )
        for i, corners in enumerate(target.all_corners_D):
            p_C, places = project(target, pose, corners)
            normal = np.cross(p_C[1] - p_C[0], p_C[0] - p_C[3])
            edges = np.linalg.norm(places - np.roll(places, 1, axis=0), axis=1)
            fits = (
                p_C[:, 2].min() >= 0.01
                and normal @ p_C[0] > 0.0
                and camera.sees(p_C).all()
                and edges.min() >= 10.0
            )
            assert bool(expected[i]) == bool(fits)
            counts[bool(fits)] += 1
            if fits:
                J = project_with_jacobian(target, pose, corners)[1][:, :3]
                variance = np.diag(J @ A @ A.T @ J.T).reshape(4, 2)
                np.testing.assert_allclose(pixels[i], places, atol=1e-8)
                np.testing.assert_allclose(sigma[i], np.sqrt(variance), rtol=1e-6)
    assert min(counts.values()) > 100
