"""Topics of a log."""

from __future__ import annotations

import typing

import pytest

import msrr_scenes.messages as messages
from msrr_bullet.log import LogError, topics


def test_every_sensor_message_has_a_topic_of_its_unit() -> None:
    found = set()
    for kind in typing.get_args(messages.SensorMessage):
        topic = topics.sensor("a", object.__new__(kind))
        assert topics.unit_of(topic) == "a"
        found.add(topic)
    assert len(found) == len(typing.get_args(messages.SensorMessage))


@pytest.mark.parametrize("topic", ["", "/x", "/sensors/a"])
def test_a_topic_that_is_none_of_a_unit_is_named(topic: str) -> None:
    with pytest.raises(LogError, match="no topic of a unit"):
        topics.unit_of(topic)
