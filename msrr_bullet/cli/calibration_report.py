"""What ``msrr calibrate`` prints and writes of a calibration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msrr_bullet.cli.picture_notes import poor_residual, same_picture
from msrr_scenes.wording import counted

if TYPE_CHECKING:  # loaded by the command, so that msrr --help is quick
    from rich.console import Console

    from msrr_perception.camera_calibration.result import CameraCalibration

#: Relative uncertainty of the focal length that calls for more pictures.
_POOR_FOCAL = 0.02


def print_report(
    console: Console,
    found: CameraCalibration,
    missed: Sequence[str],
    repeated: Sequence[tuple[str, str]],
    doubt: str,
    measures: str,
) -> None:
    """Print pictures, models and values, and what is to be said of them.

    ``missed`` are names of pictures that show no board, and ``repeated`` of those that are the same as an
    earlier one, each with the name of that. ``doubt`` speaks against the board, and is empty for nothing;
    ``measures`` are options that say what the board is like.
    """
    from rich.table import Table

    from msrr_bullet.figures.plots.coverage import covered, tilt

    table = Table("picture", "points", "residual [px]", "tilt [deg]", "")
    for view in found.views:
        cells = str(len(view.corners)), f"{view.rms_px:.2f}", f"{math.hypot(*tilt(view)):.0f}"
        table.add_row(Path(view.name).name, *cells, "" if view.used else "left out")
    console.print(table)
    if found.models:
        table = Table("free coefficients", "residual of pictures held out [px]", "")
        for model in found.models:
            word = "chosen" if model == found.model else "folds the picture" if model.folds else ""
            table.add_row(_names(model.free), f"{model.held_out_px:.3f}", word)
        console.print(table)
    table = Table("", "value", "sigma", "sigma by noise alone")
    for name, sigma in found.sigma.items():
        if sigma:
            noise = f"{found.noise_sigma[name]:.2g}"
            table.add_row(name, f"{getattr(found.told, name):.5g}", f"{sigma:.2g}", noise)
    console.print(table)
    lines = [f"no board: {name}" for name in missed]
    lines += [same_picture(*names) for names in repeated]
    lines += [
        f"left out: {view.name}: {view.rms_px:.2f} px from the rest; blurred, bent or wrongly read"
        for view in found.views
        if not view.used
    ]
    if found.sigma["fx_px"] > _POOR_FOCAL * found.told.fx_px:
        lines.append(
            "the focal length is poorly known: tilt the board more, by 30 to 45 degrees to all sides"
        )
    if found.refused is not None:
        lines.append(
            f"the lens is wider than its model: with {_names(found.refused.free)} free, pictures held out "
            f"have {found.refused.held_out_px:.3f} px, not {found.model.held_out_px:.3f}, but that lens "
            "folds the picture; sigma counts the difference"
        )
    used = sum(view.used for view in found.views)
    lines.append(
        f"{counted(used, 'picture')}: residual {found.rms_px:.3f} px RMS, "
        f"{found.model.held_out_px:.3f} px of pictures held out; "
        f"points in {100.0 * covered(found):.0f} % of the picture"
    )
    lines += poor_residual(found.rms_px, measures)
    if doubt:
        lines.append(f"the board is in doubt: {doubt}")
    console.print("\n".join(lines), soft_wrap=True, highlight=False)


def _names(free: int) -> str:
    from msrr_scenes.geometry.distortion import COEFFICIENTS

    return ", ".join(COEFFICIENTS[:free]) or "none"


def summary(
    found: CameraCalibration, missed: Sequence[str], repeated: Sequence[tuple[str, str]]
) -> dict[str, Any]:
    """Return a calibration and its pictures for a JSON file; see :func:`print_report` for the arguments."""
    return {
        "calibration": found.told.model_dump(),
        "sigma": dict(found.sigma),
        "sigma_by_noise": dict(found.noise_sigma),
        "rms_px": found.rms_px,
        "held_out_px": found.model.held_out_px,
        "free_coefficients": found.model.free,
        "models": [
            {"free_coefficients": m.free, "held_out_px": m.held_out_px, "folds": m.folds}
            for m in found.models
        ],
        "no_board": list(missed),
        "same_pictures": [list(names) for names in repeated],
        "images": [
            {"file": view.name, "points": len(view.corners), "rms_px": view.rms_px, "used": view.used}
            for view in found.views
        ],
    }
