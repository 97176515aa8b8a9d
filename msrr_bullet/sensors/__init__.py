"""Models of the sensors, which turn truth into messages: cameras, encoders, switches and command links."""

from msrr_bullet.sensors.camera import Camera, CameraError
from msrr_bullet.sensors.camera_sensors import CameraSensor, RenderedCameraSensor
from msrr_bullet.sensors.devices import Devices
from msrr_bullet.sensors.sensor_suite import SensorSuite

__all__ = [
    "Camera",
    "CameraError",
    "CameraSensor",
    "Devices",
    "RenderedCameraSensor",
    "SensorSuite",
]
