"""The software of a unit that a base station leads, for a whole mission."""

from __future__ import annotations

import math
from typing import Any

from msrr_bullet.profiler import Profiler
from msrr_bullet.robot.autonomy import Autonomy
from msrr_bullet.robot.drive_watch import DriveWatch
from msrr_bullet.robot.interface import Estimates
from msrr_bullet.robot.route_program import RouteProgram
from msrr_bullet.robot.unit_programs import UnitPrograms
from msrr_control.shapes.bodies import ACTIVE_PORT
from msrr_control.staging.guided_assembler import GuidedAssembler
from msrr_perception.tracking.seen_pose import SeenPoses
from msrr_scenes.messages import (
    OVERHEAD,
    Action,
    Conviction,
    Detections,
    Exposure,
    FailureReason,
    Fetch,
    Phase,
    SensorMessage,
    WheelOdometry,
)
from msrr_scenes.messages.coordination import Authority, LegKind, UnitMode, UnitReport
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

_FINISHED = frozenset({Phase.DONE, Phase.FAILED})

#: Speed below which a unit reports that it stands [m/s], [rad/s].
_STANDS_MPS, _STANDS_RADPS = 0.01, 0.03


class GuidedUnit:
    """Drives the routes that are granted to a unit, docks and undocks, and reports.

    What the overhead camera shows is kept for the whole mission; every route has a program of its own. One
    out of a port begins with the program that docked there, which opens the lock and backs out. Between two
    routes the unit is on standby: it only listens and reports.

    Attributes:
        route: Number of the route that the unit drives or drove last.
        docked_to: Port ``<unit>.<port>`` into which the unit believes that it is locked; None if it is free.
        dock_step: Docking or undocking of the present route; None without one.
        leaving: Whether the unit is on its way out of a port.
    """

    def __init__(
        self, scene: Scene, unit: str, docked_to: str | None = None, profiler: Profiler | None = None
    ) -> None:
        """Begin on standby, locked into the port ``docked_to`` or free."""
        self._unit, self._programs = unit, UnitPrograms(scene, unit, profiler)
        self._newest: Authority | None = None  # of the present route, or of one that has yet to begin
        self._authority: Authority | None = None  # newest of the present route
        self._program: Autonomy | RouteProgram | None = None
        self._docking: Autonomy | None = None
        self._guided: GuidedAssembler[Any] | None = None
        self._covered = 0.0
        geometry = scene.geometry(unit)
        self._drive_watch, self._offset = DriveWatch(geometry), geometry.control_offset(ACTIVE_PORT)
        self._action = Action(0, Phase.DONE, 1)
        self.route, self.leaving = 0, False
        self.docked_to = docked_to
        self.dock_step: DockStep | None = None

    @property
    def estimates(self) -> Estimates:
        """What the program of the present route estimates and believes; nothing between two routes."""
        shown = Estimates() if self._program is None else self._program.estimates
        seized = self._drive_watch.belief
        return shown if seized is None else shown._replace(belief=seized)

    @property
    def active(self) -> bool:
        """Whether the unit has something to do; else it is on standby and needs no sensors."""
        if self._drive_watch.belief is not None:
            return False
        phase = None if self._program is None else self._program.phase
        under_way = phase is not None and phase not in _FINISHED
        return under_way or (self.leaving and phase is not Phase.FAILED) or self._may_begin()

    # Inputs.

    def uses_camera(self, camera: str) -> bool:
        """Return whether the unit reads the pictures of a camera now; never those of the overhead camera."""
        return camera != OVERHEAD and self._docking is not None and self._docking.uses_camera(camera)

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
        """Read windows of an exposure and return the detections, which are used only when received."""
        return None if self._docking is None else self._docking.expose(exposure, fetch)

    def receive(self, message: SensorMessage) -> None:
        """Process a sensor message that arrives now."""
        if isinstance(message, WheelOdometry):
            self._drive_watch.read(message)
            self._programs.overhead.receive(message)
        if self._program is not None:
            self._program.receive(message)

    def see(self, seen_poses: SeenPoses) -> None:
        """Take in what the base station has read from an overhead exposure, on standby too.

        The base station looks at what stands once a second or two. Until then the collision monitor of a unit
        that sets off would know of nothing there.
        """
        self._programs.overhead.see(seen_poses)

    def authorise(self, authority: Authority) -> None:
        """Process an authority that arrives now; one that is older than another has no effect."""
        if self._newest is not None and authority.seq <= self._newest.seq:
            return
        self._newest = authority
        if authority.route != self.route:
            return
        self._authority = authority
        if self._guided is not None:
            self._guided.receive(authority)
        self._brief_guard()

    # Decisions.

    def step(self, now_ns: int) -> Action:
        """Return the action of one control instant."""
        if self.leaving and self._program is not None and self._program.phase is Phase.DONE:
            self._go_on()
            self._brief_guard()
        elif self._may_begin():
            self._begin()
            self._brief_guard()
        if self._program is None:
            self._action = Action(now_ns, Phase.DONE, 1, lock=self.docked_to is not None, reason="on standby")
            return self._action
        action = self._program.step(now_ns)
        gap = None if self._docking is None else self._docking.clear_gap
        action = self._action = self._drive_watch.judge(action, gap)
        self._note_progress()
        if action.phase is Phase.DONE and self.dock_step is not None:
            self.docked_to = None if self.leaving else self.dock_step.to
        return action

    def report(self, now_ns: int) -> UnitReport:
        """Return what is told to the base station."""
        guard = self._program.guard if self._program is not None and self.active else None
        return UnitReport(
            unit=self._unit,
            stamp_ns=now_ns,
            seq=0 if self._newest is None else self._newest.seq,
            route=self.route,
            progress=self._covered,
            mode=self._mode(),
            docked_to=self.docked_to,
            stopping=() if guard is None else guard.stopping(self.estimates.arena, now_ns),
            reason=self._action.reason,
        )

    def _brief_guard(self) -> None:
        """Tell the collision monitor what the newest authority says of others."""
        if self._program is not None and self._program.guard is not None and self._newest is not None:
            self._program.guard.brief(self._newest)

    def _mode(self) -> UnitMode:
        if self._action.phase is Phase.FAILED:
            lost = self.estimates.belief.setback is FailureReason.NOT_LOCALISED
            return UnitMode.LOST if lost else UnitMode.FAILED
        if self.docked_to is not None:
            return UnitMode.DOCKED
        if self._program is None or self._program.phase is Phase.DONE:
            return UnitMode.STANDING
        if self._program.phase is not Phase.ASSEMBLE:
            return UnitMode.DOCKING
        stands = abs(self._action.twist.v) < _STANDS_MPS and abs(self._action.twist.w) < _STANDS_RADPS
        return UnitMode.STANDING if stands else UnitMode.DRIVING

    def _may_begin(self) -> bool:
        """Return whether a route has been granted that the unit has not begun, and whose ground is free."""
        newest = self._newest
        if newest is None or newest.route == self.route or newest.limit < 0.0 or self.leaving:
            return False
        backwards = bool(newest.legs) and newest.legs[0].kind is LegKind.BACK
        return not backwards or newest.limit >= newest.legs[0].end - 1e-9

    def _begin(self) -> None:
        """Begin the route of the newest authority."""
        newest = self._authority = self._newest
        assert newest is not None
        self.route, self._covered = newest.route, 0.0
        self._drive_watch.restart()
        self._guided, self._program, docked = None, None, self._docking
        self._docking = None
        if not newest.legs:  # the unit stands where the route ends
            self.dock_step = None
            return
        if not newest.unlock:
            self._drive()
            return
        if docked is None or docked.estimates.belief.conviction is not Conviction.DOCKED:
            assert self.docked_to is not None
            docked = self._program_at(self.docked_to, docked=True)
        self._program = self._docking = docked
        docked.undock(newest.legs[0].end)
        self.leaving = True

    def _drive(self) -> None:
        """Begin the part of the route that leads forwards."""
        authority = self._authority
        assert authority is not None
        if authority.to is None:
            self.dock_step = self._docking = None
            self._program, self._guided = self._programs.along_route()
            self._guided.receive(authority)
        else:
            self._program = self._docking = self._program_at(authority.to)

    def _go_on(self) -> None:
        """Go on with the route at the instant after that in which the unit has left its port."""
        assert self._authority is not None
        self.leaving = False
        if len(self._authority.legs) > 1:
            self._drive()
        else:
            self._program = self._docking = self.dock_step = None

    def _note_progress(self) -> None:
        """Note how much of the route is covered.

        In the dock leg that is told by the distance from the port, backwards by the gap.
        """
        authority, program = self._authority, self._program
        assert authority is not None
        assert program is not None
        X = program.estimates.pose
        if self.leaving:
            if X is not None:
                gap = -(X.X_DU.x + self._offset)
                self._covered = max(self._covered, min(gap, authority.legs[0].end))
            if program.phase is Phase.DONE:
                self._covered = authority.legs[0].end
            return
        covered = 0.0 if self._guided is None else self._guided.covered
        if program is self._docking and program.phase is not Phase.ASSEMBLE:
            length = authority.legs[-1].end
            if program.phase is Phase.DONE:
                covered = length
            elif X is not None:  # without a sight of the port the unit has covered no part of its dock leg
                covered = length - math.hypot(min(X.X_DU.x + self._offset, 0.0), X.X_DU.y)
        self._covered = max(self._covered, covered)

    def _program_at(self, port: str, docked: bool = False) -> Autonomy:
        """Return the program that docks at a port; the one that undocks there, if the unit is docked."""
        assert self._authority is not None
        self.dock_step = DockStep(unit=self._unit, port=ACTIVE_PORT, to=port)
        program, self._guided = self._programs.at_port(self.dock_step, docked)
        self._guided.receive(self._authority)
        return program
