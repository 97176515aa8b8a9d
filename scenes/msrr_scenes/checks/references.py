"""Checks of names and numbers: every reference exists, and no number is used twice."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from msrr_scenes.checks.assembly import assembly_problems
from msrr_scenes.checks.problems import KeyPath, Problem
from msrr_scenes.errors import nearest
from msrr_scenes.messages import OVERHEAD, onboard_camera
from msrr_scenes.placement.placement import split_frame
from msrr_scenes.specs.faults import CameraBlackout, PortPlugged
from msrr_scenes.specs.plan import DockStep, PlanStep, UndockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import PoseSpec

#: What the names mean in a log that no body can have.
_TAKEN = {"world": "the world frame", OVERHEAD: "the overhead camera", "base_station": "the base station"}


def _poses(scene: Scene) -> Iterator[tuple[KeyPath, PoseSpec]]:
    """Yield key path and pose of every body, units first."""
    for name, unit in scene.units.items():
        yield ("units", name, "pose"), unit.pose
    for name, obstacle in scene.obstacles.items():
        yield ("obstacles", name, "pose"), obstacle.pose


def unknown_unit(scene: Scene, name: str) -> str | None:
    """Return in words that a scene has no unit of a name; None if it has one."""
    if name in scene.units:
        return None
    return f"no unit named {name!r}{nearest(name, scene.units)} Units: {', '.join(scene.units)}"


def step_key(step: PlanStep) -> str:
    """Return the key under which a step of the plan names its unit."""
    return "unit" if isinstance(step, DockStep) else "undock" if isinstance(step, UndockStep) else "move"


def camera_names(scene: Scene) -> list[str]:
    """Return the names of all cameras: ``overhead`` if there is one, ``<unit>/onboard``."""
    overhead = [OVERHEAD] if scene.cameras.overhead else []
    return overhead + [onboard_camera(unit) for unit in scene.units]


def reference_problems(scene: Scene) -> list[Problem]:
    """Return references to unknown names, poses relative to themselves, and numbers used twice."""
    problems: list[Problem] = []

    def known(path: KeyPath, unit: str) -> None:
        text = unknown_unit(scene, unit)
        if text is not None:
            problems.append(Problem(path, text))

    for i, step in enumerate(scene.plan):
        known(("plan", i, step_key(step)), step.unit)
        if not isinstance(step, DockStep):
            continue
        known(("plan", i, "to"), step.target_unit)
        if step.unit == step.target_unit:
            problems.append(
                Problem(("plan", i, "to"), f"{step.unit!r} cannot dock to itself; name another unit")
            )
    for i, dock in enumerate(scene.assembled_docks):
        known(("assembled", i), dock.unit)
        known(("assembled", i), dock.target_unit)
    for path, pose in _poses(scene):
        frame = split_frame(pose.frame)
        if frame:
            known((*path, "frame"), frame[0])
    for i, fault in enumerate(scene.faults):
        if isinstance(fault, CameraBlackout):
            cameras = camera_names(scene)
            if fault.camera not in cameras:
                near = nearest(fault.camera, cameras)
                text = f"no camera {fault.camera!r}{near} Cameras: {', '.join(cameras)}"
                problems.append(Problem(("faults", i, "camera"), text))
        else:
            known(("faults", i, "unit"), fault.unit)
    for kind, bodies in (("units", scene.units), ("obstacles", scene.obstacles)):
        for name in bodies.keys() & _TAKEN.keys():
            text = f"{name!r} is the name of {_TAKEN[name]} in logs; give the body another one"
            problems.append(Problem((kind, name), text))
    for name in scene.obstacles:
        if name in scene.units:
            text = f"a unit is named {name!r} as well; names of bodies have to differ"
            problems.append(Problem(("obstacles", name), text))
    return problems or [*assembly_problems(scene), *_numbers_twice(scene)] or list(_frame_cycles(scene))


def _frame_cycles(scene: Scene) -> Iterator[Problem]:
    for unit in scene.units:
        chain = [unit]
        while frame := split_frame(scene.start_pose(chain[-1]).frame):
            chain.append(frame[0])
            if frame[0] in chain[:-1]:
                break
        if len(chain) > 1 and chain[-1] == unit:
            text = f"placed relative to itself ({' -> '.join(chain)}); give one of them in frame world"
            yield Problem(("units", unit, "pose", "frame"), text)


def _numbers_twice(scene: Scene) -> Iterator[Problem]:
    seen: dict[int, str] = {}
    for unit, spec in scene.units.items():
        if spec.number in seen:
            free = next(
                n for n in range(len(scene.units) + 1) if n not in {u.number for u in scene.units.values()}
            )
            text = f"unit {seen[spec.number]!r} has the number {spec.number} already; {free} is free"
            yield Problem(("units", unit, "number"), text)
        seen.setdefault(spec.number, unit)


def value_problems(scene: Scene) -> list[Problem]:
    """Return values that contradict each other."""
    problems: list[Problem] = []
    for axis in ("x_m", "y_m"):
        low, high = getattr(scene.arena, axis)
        if low >= high:
            problems.append(Problem(("arena", axis), f"expected [low, high], found [{low:g}, {high:g}]"))
    los = scene.los
    if los.inner_deg >= los.outer_deg:
        text = f"the inner bound has to be below los.outer_deg = {los.outer_deg:g}, found {los.inner_deg:g}"
        problems.append(Problem(("los", "inner_deg"), text))
    if scene.limits.v_close_mps > scene.limits.v_max_mps:
        text = f"the close-range speed cannot exceed limits.v_max_mps = {scene.limits.v_max_mps:g}"
        problems.append(Problem(("limits", "v_close_mps"), text))
    if scene.control.rate_hz > scene.physics_hz:
        text = (
            f"control cannot be faster than the physics, physics_hz = {scene.physics_hz:g}, found "
            f"{scene.control.rate_hz:g}; lower it or raise physics_hz"
        )
        problems.append(Problem(("control", "rate_hz"), text))
    for name, obstacle in scene.obstacles.items():
        if obstacle.tag_id is None and obstacle.tag_m != type(obstacle).model_fields["tag_m"].default:
            text = "changes nothing without a tag; give tag_id as well, or leave it out"
            problems.append(Problem(("obstacles", name, "tag_m"), text))
    for i, fault in enumerate(scene.faults):
        if isinstance(fault, CameraBlackout) and fault.from_s >= fault.to_s:
            text = f"the blackout ends before it begins (from_s = {fault.from_s:g}, to_s = {fault.to_s:g})"
            problems.append(Problem(("faults", i, "to_s"), text))
    return problems


def port_problems(scene: Scene) -> list[Problem]:
    """Return ports that do not exist or are of the wrong kind, and tag ids used twice."""
    problems: list[Problem] = []

    def has(
        path: KeyPath, unit: str, port: str, heading: str = "Ports", fitting: Sequence[str] | None = None
    ) -> bool:
        ports = scene.geometry(unit).ports
        if port not in ports:
            known = ports if fitting is None else fitting
            text = f"unit {unit!r} has no port {port!r}{nearest(port, known)} {heading}: {', '.join(known)}"
            problems.append(Problem(path, text))
        return port in ports

    def passive(path: KeyPath, unit: str, port: str) -> None:
        geometry = scene.geometry(unit)
        known = geometry.passive_ports
        if has(path, unit, port, "Passive ports", known) and port not in known:
            text = f"port {port!r} of {unit!r} has no tags and no holes to dock to"
            if port not in geometry.active_ports:
                usual = f"port_{port}_marker_left"
                near = nearest(usual, [name for name in geometry.frames if "_mark" in name])
                text = (
                    f"port {port!r} of {unit!r} has no tag{near} Nobody finds a port without one, so give it "
                    f"a link or frame port_{port}_marker_<tag>, or `markers`"
                )
            problems.append(Problem(path, f"{text}; passive ports: {', '.join(known)}"))

    def active(path: KeyPath, unit: str, port: str) -> None:
        geometry = scene.geometry(unit)
        known = geometry.active_ports
        if has(path, unit, port, "Active ports", known) and port not in known:
            text = f"port {port!r} of {unit!r} has no pins; active ports: {', '.join(known)}"
            problems.append(Problem(path, text))

    for i, step in enumerate(scene.plan):
        if isinstance(step, DockStep):
            active(("plan", i, "port"), step.unit, step.port)
            passive(("plan", i, "to"), step.target_unit, step.target_port)
    for i, dock in enumerate(scene.assembled_docks):
        active(("assembled", i), dock.unit, dock.port)
        passive(("assembled", i), dock.target_unit, dock.target_port)
    for path, pose in _poses(scene):
        frame = split_frame(pose.frame)
        if frame:
            has((*path, "frame"), *frame)
    for i, fault in enumerate(scene.faults):
        if isinstance(fault, PortPlugged):
            passive(("faults", i, "port"), fault.unit, fault.port)
    return problems + list(_tags_twice(scene))


def _tags_twice(scene: Scene) -> Iterator[Problem]:
    seen: dict[int, str] = {}
    family = scene.tags.tag_family
    for path, owner, tag in _all_tags(scene):
        if not 0 <= tag < family.ids:
            text = f"{owner} has tag id {tag}; the family {family.name} has 0 .. {family.ids - 1}"
            yield Problem(path, text)
        elif tag in seen:
            yield Problem(
                path, f"{owner} has tag id {tag}, which {seen[tag]} has already; give it another one"
            )
        seen.setdefault(tag, owner)
    for unit, spec in scene.units.items():
        slots = scene.geometry(unit).tag_slots
        for key, named in (("tag_ids", spec.tag_ids), ("tag_sizes_m", spec.tag_sizes_m)):
            yield from unknown_slots(("units", unit, key), named, slots)


def unknown_slots(path: KeyPath, named: Iterable[str], slots: Sequence[str]) -> Iterator[Problem]:
    """Yield the names, at a path of a document, that are no links with a tag."""
    for slot in (name for name in named if name not in slots):
        text = f"no such tag link{nearest(slot, slots)} Links with a tag: {', '.join(slots)}"
        yield Problem((*path, slot), text)


def _all_tags(scene: Scene) -> Iterator[tuple[KeyPath, str, int]]:
    for unit, spec in scene.units.items():
        for slot, tag in scene.tag_ids(unit).items():
            path: KeyPath = ("units", unit, "tag_ids", slot) if slot in spec.tag_ids else ("units", unit)
            yield path, f"{unit}/{slot}", tag
    for name, obstacle in scene.obstacles.items():
        if obstacle.tag_id is not None:
            yield ("obstacles", name, "tag_id"), name, obstacle.tag_id
