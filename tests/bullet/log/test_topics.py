"""Topics of a log."""

from __future__ import annotations

import typing

import msrr_scenes.messages as messages
from msrr_bullet.log import topics


def test_every_sensor_message_has_a_topic_of_its_unit() -> None:
    found = set()
    for kind in typing.get_args(messages.SensorMessage):
        topic = topics.sensor("a", object.__new__(kind))
        assert topics.unit_of(topic) == "a"
        found.add(topic)
    assert len(found) == len(typing.get_args(messages.SensorMessage))
