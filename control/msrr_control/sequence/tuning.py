"""The figures by which the phase machine decides and which a scene does not name."""

from __future__ import annotations

from pydantic import Field

from msrr_control.docking.retreat import RetreatSpec
from msrr_control.sequence.search import SearchSpec
from msrr_scenes.specs.spec import Angle, Distance, Duration, Gain, Length, NonNegative, Spec, Time, Tolerance


class CalibrationDriveSpec(Spec):
    """Way and turns of the drive.

    Near the port the tags are large, and turning there shows the camera's mount: seen from the same place at
    different headings, an offset of the camera moves the target by amounts that no pose explains.

    Attributes:
        near_m: Gap between the faces at which the unit turns.
        headings_deg: Headings to which it turns there, one after another.
        far_m: Gap between the faces to which it backs out in the end.
        turn_per_s: Gain from the error of the heading to the turn rate.
        turn_radps: Largest turn rate; at more, tags are smeared over several pixels.
        heading_tolerance_deg: Error of the heading at which a turn has ended.
        arrived_m: Distance to the end of the drive at which the unit has arrived.
        time_s: Time after which the drive ends wherever the unit is.
    """

    near_m: Length = 0.3
    headings_deg: tuple[Angle, ...] = Field(default=(25.0, -25.0, 25.0, 0.0), max_length=20)
    far_m: Length = 0.6
    turn_per_s: Gain = 2.5
    turn_radps: NonNegative = 0.4
    heading_tolerance_deg: Tolerance = 2.0
    arrived_m: Length = 0.01
    time_s: Duration = 40.0


class PhaseTuning(Spec):
    """Figures of the phase machine that follow from the mechanism and the sensors, not from the task.

    Attributes:
        ready_sigma_m: Largest standard deviation of the lateral estimate at the hand-over.
        ready_sigma_deg: Largest standard deviation of the heading at the hand-over.
        ready_time_s: Time for which a target may be seen, but uncertain or outside the cone, before the
            attempt ends; a search in between, and the slow approach, do not count.
        contact_m: Gap beyond the pins' length at which pressing replaces the controller.
        capture_share: Share of the way from the middle of a mouth to its edge from which the funnel still
            centres a pin; nearer to the edge it may jam.
        capture_deg: Largest heading error from which the funnel still centres the pins.
        press_turn_radps: Largest turn rate while pressing.
        debounce_s: Time for which both switches have to stay closed, or open, to be believed.
        parted_s: Time for which both switches may be open at the port after one of them had closed there, if
            the unit comes no nearer; in a port that holds it while it presses, one of them stays closed.
        slower_share: Share of its speed at the port that a unit keeps after an attempt in which it slipped.
        slowing_s: Time constant with which such a unit slows down to that speed on its way to the port, which
            a drive may lag behind by half a second.
        switch_travel_m: Way of the pins from where the seat switches close to the bottom of the holes.
        near_m: Deviation from the seated gap that agrees with closed switches (verification by sight only).
        seated_gap_m: Gap that is left between the faces of a seated pair.
        progress_m: Smallest approach to the seat that counts as progress.
        progress_share: Share of the speed promised by the controller that the approach has to keep, on
            average over ``docking.stall_time_s``. Healthy approaches of all five laws keep 0.2 and more.
        doubt_s: Time for which a unit waits in front of a port for others to be seen again.
        latch_s: Time that the lock may take to report closed.
        latch_margin_s: Time given to the lock beyond what it takes to close, if that is longer.
        unlatch_s: Time that the lock may take to report open before the unit backs out regardless.
        look_around_s: Time for which the unit waits for an overhead picture before it backs out regardless.
        frames: Number of frames in a row that have to agree at verification.
        arrived_m: Distance to the end of the retreat at which the unit has arrived.
        settle_s: Pause after backing out, or after a tug.
        retreat_margin_s: Time given to a retreat beyond what its distance takes.
        retreat: How the unit backs out.
        search: How the unit looks for its target.
        calibration: How the unit drives to calibrate its camera and wheels.
    """

    ready_sigma_m: Length = 0.02
    ready_sigma_deg: Tolerance = 3.0
    ready_time_s: Duration = 6.0
    contact_m: Length = 0.003
    capture_share: float = Field(default=0.8, gt=0.0, le=1.0)
    capture_deg: Tolerance = 7.0
    press_turn_radps: NonNegative = 0.4
    debounce_s: Time = 0.1
    parted_s: Time = 0.3
    slower_share: float = Field(default=0.35, gt=0.0, le=1.0)
    slowing_s: Duration = 2.0
    switch_travel_m: Length = 0.002
    near_m: Length = 0.004
    seated_gap_m: Distance = 0.0
    progress_m: Length = 0.001
    progress_share: float = Field(default=0.1, ge=0.0, le=1.0)
    doubt_s: Duration = 30.0
    latch_s: Duration = 3.0
    latch_margin_s: Duration = 1.0
    unlatch_s: Duration = 2.0
    look_around_s: Duration = 1.0
    frames: int = Field(default=3, ge=1, le=100)
    arrived_m: Length = 0.01
    settle_s: Time = 0.3
    retreat_margin_s: Duration = 3.0
    retreat: RetreatSpec = RetreatSpec()
    search: SearchSpec = SearchSpec()
    calibration: CalibrationDriveSpec = CalibrationDriveSpec()
