"""Writes the tables of ``docs/explanation/architecture.md`` that follow from the code.

Run ``python docs/make_architecture.py`` after a change of the packages or of their imports. A test compares
the page with what this script would write.
"""

from __future__ import annotations

import ast
import importlib.util
from collections.abc import Mapping
from pathlib import Path

import grimp

PAGE = Path(__file__).resolve().parent / "explanation" / "architecture.md"
ROOTS = ("msrr_scenes", "msrr_perception", "msrr_control", "msrr_bullet")

Graph = Mapping[str, frozenset[str]]

#: The way of a frame of the onboard camera, from exposure to wheel torque: functions in the order in which
#: they are called, each with what it passes on. An empty name is a time of waiting.
FRAME: tuple[tuple[str, str], ...] = (
    ("msrr_bullet.sensors.sensor_suite:SensorSuite.tick", "a frame is due"),
    ("msrr_bullet.sensors.camera_sensors:RenderedCameraSensor.capture", ""),
    ("msrr_bullet.sensors.camera:Camera.expose", "Exposure"),
    ("msrr_bullet.robot.autonomy:Autonomy.expose", ""),
    ("msrr_perception.detection.onboard_vision:OnboardVision.detect", "Window"),
    ("msrr_bullet.sensors.camera:Camera.fetch", ""),
    ("msrr_bullet.render.raster_renderer:RasterRenderer.render", "noise-free pixels"),
    ("msrr_bullet.sensors.image_noise:ImageNoise.read_out", "pixels"),
    (
        "msrr_perception.detection.detector:PupilDetector.detect",
        "Detections, after the camera latency",
    ),
    ("msrr_bullet.robot.autonomy:Autonomy.receive", ""),
    ("msrr_perception.estimation.corner_filter:CornerEkf.add_detections", "at the next control instant"),
    ("msrr_bullet.robot.autonomy:Autonomy.step", ""),
    ("msrr_perception.estimation.corner_filter:CornerEkf.estimate", "PoseEstimate"),
    ("msrr_perception.estimation.los:LosEstimator.observe", "LosObservation"),
    ("msrr_control.sequence.state_machine:PhaseMachine.step", ""),
    ("msrr_control.docking.controller:LawController.step", "Twist"),
    ("msrr_bullet.robot.collision_monitor:CollisionMonitor.limit", "Action"),
    ("msrr_bullet.sensors.command_link:CommandLink.send", "after the latency of the link"),
    ("msrr_bullet.simulation.bullet_plant:BulletPlant.command", "at every physics tick"),
    ("msrr_bullet.plant.limited_drive:LimitedDrive.step", "velocity within the nested limits"),
    ("msrr_bullet.simulation.wheel_motors:WheelMotors.drive", "wheel torque"),
)


def package_graph(root: str) -> Graph:
    """Return which packages and single files directly below ``root`` import which others.

    The file that ``python -m`` runs is left out: nothing imports it.
    """
    graph = grimp.build_graph(root, cache_dir=None)
    graph.remove_module(f"{root}.__main__")
    imports: dict[str, set[str]] = {m.rpartition(".")[2]: set() for m in graph.find_children(root)}
    for module in graph.modules - {root}:
        package = module.split(".")[1]
        for imported in graph.find_modules_directly_imported_by(module):
            if imported != root:
                imports[package].add(imported.split(".")[1])
    return {package: frozenset(found - {package}) for package, found in imports.items()}


def levels(graph: Graph) -> dict[str, int]:
    """Return the level of every package: one more than the highest level that it imports.

    Raises:
        ValueError: The packages import each other in a circle.
    """
    found: dict[str, int] = {}

    def level(package: str, above: tuple[str, ...]) -> int:
        if package in above:
            raise ValueError(f"packages import each other in a circle: {' -> '.join((*above, package))}")
        if package not in found:
            found[package] = 1 + max((level(p, (*above, package)) for p in graph[package]), default=0)
        return found[package]

    for package in graph:
        level(package, ())
    return found


def reduced(graph: Graph) -> Graph:
    """Return the graph without the imports that a chain of other imports implies."""

    def reached(package: str) -> set[str]:
        return set(graph[package]).union(*(reached(p) for p in graph[package]))

    return {
        package: frozenset(p for p in imports if not any(p in reached(q) for q in imports - {p}))
        for package, imports in graph.items()
    }


def purpose(root: str, name: str) -> str:
    """Return the first sentence of the docstring of ``root.name``."""
    spec = importlib.util.find_spec(f"{root}.{name}")
    assert spec is not None
    assert spec.origin is not None
    text = ast.get_docstring(ast.parse(Path(spec.origin).read_text())) or ""
    return " ".join(text.split("\n\n")[0].split())


def packages_section(root: str) -> str:
    """Return the table of the packages of ``root``, with what each imports."""
    graph = package_graph(root)
    level, imports = levels(graph), reduced(graph)
    order = sorted(graph, key=lambda name: (-level[name], name))
    lines = ["| level | package | purpose | imports |", "|---|---|---|---|"]
    for name in order:
        imported = ", ".join(f"`{other}`" for other in sorted(imports[name]))
        lines.append(f"| {level[name]} | `{name}` | {purpose(root, name)} | {imported} |")
    return "\n".join(lines)


def frame_section() -> str:
    """Return the table of the way of a frame."""
    lines = ["| function | module | passes on |", "|---|---|---|"]
    for path, passed_on in FRAME:
        module, _, name = path.partition(":")
        lines.append(f"| `{name}` | `{module}` | {passed_on} |")
    return "\n".join(lines)


def page(text: str) -> str:
    """Return the page with the sections between its markers written anew."""
    sections = {f"packages of {root}": packages_section(root) for root in ROOTS}
    sections["way of a frame"] = frame_section()
    for name, section in sections.items():
        begin, end = f"<!-- begin: {name} -->\n", f"\n<!-- end: {name} -->"
        head, _, rest = text.partition(begin)
        _, _, tail = rest.partition(end)
        text = f"{head}{begin}{section}{end}{tail}"
    return text


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text()))
