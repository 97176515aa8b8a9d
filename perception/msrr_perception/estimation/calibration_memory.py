"""What a unit has learned of errors of calibration, which it keeps from one docking to the next."""

from __future__ import annotations

from msrr_perception.motion.filter_state import CalibrationEstimate


class CalibrationMemory:
    """Keeps what a unit has learned during a trial, of itself and of each port."""

    def __init__(self) -> None:
        """Begin with the drawing alone."""
        self._ports: dict[str, CalibrationEstimate] = {}
        self._newest: CalibrationEstimate | None = None

    def keep(self, port: str, estimate: CalibrationEstimate) -> None:
        """Keep what was learned at a port ``<unit>.<port>``."""
        self._ports[port] = self._newest = estimate

    def recall(self, port: str, prior: CalibrationEstimate) -> CalibrationEstimate:
        """Return what is known at a port ``<unit>.<port>``, of which the drawing alone says ``prior``.

        What was learned of the unit itself at another port later on is not combined with what this port
        taught: both rest on the same errors of the camera, and their correlation is not kept.
        """
        known = self._ports.get(port)
        if known is not None:
            return known
        return prior if self._newest is None else self._newest.of_another_target(prior)
