"""Draws ``unit.svg``, the dimensioned drawing of the unit, from its URDF alone.

Run ``python urdf/draw_unit.py [OUT]`` after a change of the URDF. Every number on the drawing is measured on
the frames and collision shapes that :func:`msrr_scenes.geometry.unit_geometry.read_unit` reads. Only the
sizes of the tags, which a scene decides, are the defaults of :class:`msrr_scenes.specs.bodies.TagsSpec`.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.unit_geometry import UnitGeometry, find_urdf, read_unit, tag_corners
from msrr_scenes.specs.bodies import TagsSpec

PORT = "rear"
SHADE, EDGE, TAG, DIMENSION, CAMERA = "#d9d9d9", "#444444", "#2266aa", "#aa3322", "#227744"
VIEWS = {"plan": (0, 1), "rear": (1, 2), "side": (0, 2)}
#: Line of sight of each view: shapes are painted from far to near.
DEPTH = {"plan": (2, 1.0), "rear": (0, -1.0), "side": (1, -1.0)}


def are_inside(unit: UnitGeometry, points: Array) -> NDArray[np.bool_]:
    """Return which points of U, shape (N, 3) [m], lie inside a box of the unit."""
    inside = np.zeros(len(points), dtype=bool)
    for solid in unit.solids:
        if solid.kind == "box":
            local = np.abs(solid.X_UG.inverse().act(points))
            inside |= np.all(local <= 0.5 * np.asarray(solid.size) + 1e-9, axis=1)
    return inside


def hole_widths(unit: UnitGeometry) -> tuple[float, float, float, float]:
    """Measure a hole of the rear port at the height of the pins.

    Returns:
        Width of the mouth, width of the throat, depth of the bottom plate, depth where the throat begins [m].
    """
    X_UD, pin = unit.dock_frame(PORT), unit.frame("pin_left")
    y_0, z = float(pin.p[1]), float(pin.p[2])
    side = np.arange(0.0, 0.05, 5e-5)

    def width(depth: float) -> float:
        reach = 0.0
        for sign in (1.0, -1.0):
            xy = X_UD.act(np.stack([np.full_like(side, depth), y_0 + sign * side], axis=1))
            blocked = are_inside(unit, np.column_stack([xy, np.full(len(side), z)]))
            reach += float(side[np.argmax(blocked)])
        return reach

    depths = np.arange(5e-5, 0.05, 5e-5)
    axis = X_UD.act(np.stack([depths, np.full_like(depths, y_0)], axis=1))
    bottom = float(depths[np.argmax(are_inside(unit, np.column_stack([axis, np.full(len(depths), z)])))])
    widths = np.array([width(d) for d in depths[depths < bottom]])
    narrow = depths[int(np.argmax(widths <= widths.min() + 1e-4))]
    return widths[0], float(widths.min()), bottom, float(narrow)


def paint(ax: Axes, unit: UnitGeometry, view: str, section_z: float | None = None) -> None:
    """Draw the shapes of the unit seen in ``view``, or only those that a plane z = ``section_z`` [m] cuts."""
    i, j = VIEWS[view]
    axis, sign = DEPTH[view]
    for solid in sorted(unit.solids, key=lambda s: sign * float(s.X_UG.p[axis])):
        if solid.kind == "sphere":
            disc = Circle(
                (solid.X_UG.p[i], solid.X_UG.p[j]), solid.size[0], ec=EDGE, fc="none", lw=0.6, ls=":"
            )
            ax.add_patch(disc)
            continue
        P = solid.points()
        flat = P[:, [i, j]]
        outline = flat[ConvexHull(flat).vertices]
        cut = section_z is None or P[:, 2].min() <= section_z <= P[:, 2].max()
        if cut:
            ax.add_patch(Polygon(outline, fc=SHADE, ec=EDGE, lw=0.5))
    if view == "plan":
        ax.add_patch(Polygon(unit.footprint, fill=False, ec=EDGE, lw=1.0))
    tags = TagsSpec()
    for slot in unit.tag_slots:
        if view == "rear" and not slot.startswith(f"port_{PORT}"):
            continue
        quad = unit.frame(slot).act(tag_corners(tags.size(slot)))[:, [i, j]]
        ax.add_patch(Polygon(quad, fill=False, ec=TAG, lw=1.2))
    camera = unit.frame("camera")
    ax.plot(*camera.p[[i, j]], marker="o", ms=4, color=CAMERA, zorder=5)
    if view != "rear":
        ahead = camera.p + 0.05 * camera.R[:, 0]
        ax.annotate("", ahead[[i, j]], camera.p[[i, j]], arrowprops={"arrowstyle": "->", "color": CAMERA})
    if view != "plan":
        ax.axhline(0.0, color=EDGE, lw=0.8)


def span(
    ax: Axes, start: tuple[float, float], end: tuple[float, float], text: str = "", gap: float = 0.004
) -> None:
    """Draw a dimension between two points, labelled with their distance in millimetres or ``text``."""
    length = math.dist(start, end)
    ax.annotate(
        "",
        end,
        start,
        annotation_clip=False,
        arrowprops={"arrowstyle": "<->", "color": DIMENSION, "lw": 0.7, "shrinkA": 0, "shrinkB": 0},
    )
    ax.update_datalim([start, end])
    angle = math.degrees(math.atan2(end[1] - start[1], end[0] - start[0]))
    along = angle if -90.0 < angle <= 90.0 else angle - 180.0
    normal = np.array([-math.sin(math.radians(along)), math.cos(math.radians(along))])
    middle = 0.5 * (np.asarray(start) + np.asarray(end)) + gap * normal
    label = text or f"{1e3 * length:.4g}"
    ax.text(
        *middle,
        label,
        color=DIMENSION,
        size=7,
        rotation=along,
        ha="center",
        va="center",
        rotation_mode="anchor",
    )


def level(ax: Axes, z: float, x: float, text: str) -> None:
    """Mark a height above the ground with a leader that ends at ``x``, to the right of the view."""
    ax.plot([x - 0.012, x], [z, z], color=DIMENSION, lw=0.6)
    ax.text(x + 0.002, z, f"{1e3 * z:.4g}  {text}", color=DIMENSION, size=7, va="center")


def draw_plan(ax: Axes, unit: UnitGeometry) -> None:
    """Draw the section at the height of the pins, seen from above."""
    pin = unit.frame("pin_left").p
    paint(ax, unit, "plan", float(pin[2]))
    P = unit.footprint
    x_0, x_face, x_tip = float(P[:, 0].min()), unit.control_offset("front"), float(P[:, 0].max())
    y_0, y_1 = float(P[:, 1].min()), float(P[:, 1].max())
    mouth, throat, depth, narrow = hole_widths(unit)
    span(ax, (x_0, y_0 - 0.026), (x_face, y_0 - 0.026))
    span(ax, (x_face, y_0 - 0.026), (x_tip, y_0 - 0.026))
    span(ax, (0.0, y_0 - 0.042), (x_face, y_0 - 0.042), f"l = {1e3 * x_face:.4g}")
    span(ax, (x_tip + 0.02, -pin[1]), (x_tip + 0.02, pin[1]), gap=-0.005)
    y_pin = np.concatenate([s.points()[:, 1] for s in unit.solids if s.link == "pin_left"])
    low, high = y_pin.min(), y_pin.max()
    span(ax, (x_tip + 0.008, low), (x_tip + 0.008, high), gap=-0.004)
    rear = float(unit.port(PORT).x)
    span(
        ax, (rear - 0.008, pin[1] - mouth / 2), (rear - 0.008, pin[1] + mouth / 2), f"mouth {1e3 * mouth:.3g}"
    )
    span(ax, (rear + narrow, pin[1] - throat / 2), (rear + narrow, pin[1] + throat / 2), gap=-0.006)
    span(ax, (rear, -pin[1]), (rear + depth, -pin[1]))
    wheel = unit.frame("wheel_left").p
    span(ax, (wheel[0], -wheel[1]), (wheel[0], wheel[1]), f"track {1e3 * unit.track:.4g}", gap=0.005)
    for name in unit.ports:
        X_UP = unit.port(name)
        ax.text(
            *X_UP.act([0.01, 0.0]),
            name,
            size=8,
            ha="center",
            va="center",
            rotation=90 * (name in ("front", "rear")),
        )
    corner = float(np.abs(P).sum(axis=1).max())
    ax.text(x_0, y_1 + 0.006, f"corners cut by {1e3 * (x_face + y_1 - corner):.3g}", size=7, color=DIMENSION)
    ax.set_title(f"Section at z = {1e3 * pin[2]:.4g} mm, from above; tags in blue", size=9)


def draw_rear(ax: Axes, unit: UnitGeometry) -> None:
    """Draw the rear port as an approaching unit sees it."""
    paint(ax, unit, "rear")
    ax.invert_xaxis()
    y = float(unit.footprint[:, 1].min())
    tag = unit.frame(f"port_{PORT}_marker_left")
    X_DT = unit.dock_frame(PORT).inverse().act(tag.p[:2])
    cant = math.degrees(math.acos(min(abs(float(tag.R[0, 2])), 1.0)))
    for link, text in (
        ("wheel_left", "axle"),
        ("pin_left", "pins and holes"),
        (
            f"port_{PORT}_marker_left",
            f"side tags: {1e3 * X_DT[0]:.4g} in, +-{1e3 * X_DT[1]:.4g}, cant {cant:.3g} deg",
        ),
        ("camera", "camera"),
        (f"port_{PORT}_marker_middle", "mast tag"),
        ("tag_top", "top tag"),
    ):
        z = float(unit.frame(link).p[2])
        ax.plot([y - 0.004, y - 0.016], [z, z], color=DIMENSION, lw=0.6)
        ax.text(y - 0.018, z, f"{1e3 * z:.4g}  {text}", color=DIMENSION, size=7, va="center")
    pin = unit.frame("pin_left").p[1]
    span(ax, (pin, 0.052), (-pin, 0.052))
    ax.set_title("Rear port, as an approaching unit sees it", size=9)


def draw_side(ax: Axes, unit: UnitGeometry) -> None:
    """Draw the unit from the right-hand side."""
    paint(ax, unit, "side")
    z_band = np.concatenate([s.points()[:, 2] for s in unit.solids if s.link == f"port_{PORT}_funnel"])
    low, high = float(z_band.min()), float(z_band.max())
    x = float(unit.footprint[:, 0].max())
    for z, text in ((low, "port band"), (high, "deck")):
        level(ax, z, x + 0.02, text)
    front, rear = unit.frame("caster_front").p[0], unit.frame("caster_rear").p[0]
    span(ax, (rear, -0.014), (front, -0.014), f"casters {1e3 * (front - rear):.4g}", gap=-0.006)
    middle = unit.dock_frame(PORT).inverse().act(unit.frame(f"port_{PORT}_marker_middle").p[:2])[0]
    rear_x, z = float(unit.port(PORT).x), float(unit.frame(f"port_{PORT}_marker_middle").p[2])
    span(ax, (rear_x, z), (rear_x + middle, z))
    ax.set_title("From the right", size=9)


def draw(unit: UnitGeometry) -> Figure:
    """Return the drawing of a unit."""
    figure = Figure(figsize=(11.0, 8.2), layout="constrained")
    axes = figure.subplot_mosaic([["plan", "rear"], ["plan", "side"]], width_ratios=[1.15, 1.0])
    for name, painter in (("plan", draw_plan), ("rear", draw_rear), ("side", draw_side)):
        painter(axes[name], unit)
        axes[name].set_aspect("equal")
        axes[name].autoscale_view()
        axes[name].margins(0.08)
        axes[name].axis("off")
    figure.suptitle(f"{unit.urdf.name}: dimensions in millimetres", size=11)
    return figure


def main() -> None:
    """Write the drawing to the file named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("out", nargs="?", type=Path, default=Path(__file__).with_name("unit.svg"))
    out = parser.parse_args().out
    # No date and no random ids: the same URDF gives the same file.
    with mpl.rc_context({"svg.hashsalt": "unit", "svg.fonttype": "none"}):
        draw(read_unit(find_urdf("unit.urdf"))).savefig(
            out, metadata={"Date": None} if out.suffix == ".svg" else None
        )


if __name__ == "__main__":
    main()
