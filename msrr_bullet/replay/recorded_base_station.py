"""Records everything that passes between a trial and its base station, as a replay needs it."""

from __future__ import annotations

from msrr_bullet.base_station.base_station import BASE_STATION, BaseStation
from msrr_bullet.log import topics
from msrr_bullet.log.records import RadioReceipt
from msrr_bullet.replay.recorded_robot import RecordedReader
from msrr_perception.tracking.seen_pose import SeenPoses
from msrr_scenes.messages import Detections, GlobalPose
from msrr_scenes.messages.coordination import Authority, UnitReport


class RecordedBaseStation(RecordedReader[BaseStation]):
    """A base station whose inputs and outputs are recorded."""

    def see(self, message: Detections | GlobalPose) -> SeenPoses:
        """Record a message of the overhead camera as it arrives."""
        now_ns = self._now_ns()
        self._recorder.write(topics.sensor(BASE_STATION, message), now_ns, message)
        return self.program.see(message)

    def hear(self, report: UnitReport) -> None:
        """Record that a report has arrived."""
        now_ns = self._now_ns()
        receipt = RadioReceipt(now_ns, report.unit, report.stamp_ns)
        self._recorder.write(topics.report_received(report.unit), now_ns, receipt)
        self.program.hear(report, now_ns)

    def step(self, now_ns: int) -> list[Authority]:
        """Record how the mission stands, and the authorities that are sent."""
        authorities = self.program.step(now_ns)
        self._recorder.write(topics.MISSION, now_ns, self.program.status)
        for authority in authorities:
            self._recorder.write(topics.authority(authority.unit), now_ns, authority)
        return authorities
