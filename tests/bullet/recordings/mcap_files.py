"""MCAP files of images and odometry, as Foxglove and ROS 2 write them."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from mcap.writer import Writer
from mcap_ros2.writer import Writer as Ros2Writer

from msrr_scenes.messages import NS_PER_S, Pixels, WheelOdometry

Frames = Iterable[tuple[int, int, Pixels]]
Wheels = Iterable[tuple[int, WheelOdometry]]

_STAMP = "std_msgs/Header header\n"
_HEADER = (
    "=" * 80
    + "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    + "=" * 80
    + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
COMPRESSED = _STAMP + "string format\nuint8[] data\n" + _HEADER
RAW = (
    _STAMP
    + "uint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data\n"
    + _HEADER
)
JOINTS = _STAMP + "string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n" + _HEADER
INFO = (
    _STAMP
    + "uint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n"
    + "float64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n"
    + _HEADER
    + "=" * 80
    + "\nMSG: sensor_msgs/RegionOfInterest\nuint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\n"
)


def png(pixels: Pixels) -> bytes:
    return cv2.imencode(".png", pixels)[1].tobytes()


def _ros_header(stamp_ns: int) -> dict[str, Any]:
    return {"stamp": {"sec": stamp_ns // NS_PER_S, "nanosec": stamp_ns % NS_PER_S}, "frame_id": "camera"}


def write_ros2(
    path: Path,
    frames: Frames,
    wheels: Wheels,
    raw: bool = False,
    start_ns: int = 0,
    image_topic: str = "/camera/image",
    info_topics: tuple[str, ...] = ("/camera/camera_info",),
    ordered: bool = True,
    **told: Any,
) -> Path:
    """Write images, compressed or raw, joint states of the wheels, and the calibration of the camera.

    Messages stand in the order of arrival unless ``ordered`` is false; ``told`` replaces fields of the
    calibration on the last of its topics.
    """
    kind = "Image" if raw else "CompressedImage"
    with path.open("wb") as file:
        writer = Ros2Writer(file)
        images = writer.register_msgdef(f"sensor_msgs/msg/{kind}", RAW if raw else COMPRESSED)
        joints = writer.register_msgdef("sensor_msgs/msg/JointState", JOINTS)
        info = writer.register_msgdef("sensor_msgs/msg/CameraInfo", INFO)
        messages: list[tuple[int, str, Any, dict[str, Any]]] = []
        for arrival, reading in wheels:
            position = [reading.right, reading.left]
            state = {"header": _ros_header(start_ns + reading.stamp_ns), "name": ["r", "l"]}
            messages.append((arrival, "/joint_states", joints, {**state, "position": position}))
        for stamp, arrival, pixels in frames:
            image: dict[str, Any] = {"header": _ros_header(start_ns + stamp)}
            height, width = pixels.shape
            if raw:
                image |= {"height": height, "width": width, "encoding": "mono8", "is_bigendian": 0}
                image |= {"step": width, "data": pixels.tobytes()}
            else:
                image |= {"format": "png", "data": png(pixels)}
            messages.append((arrival, image_topic, images, image))
            calibration = {"height": height, "width": width, "distortion_model": "plumb_bob", "d": [0.0] * 5}
            K = [FOCAL, 0.0, 0.5 * (width - 1), 0.0, FOCAL, 0.5 * (height - 1), 0.0, 0.0, 1.0]
            calibration |= {"k": K, "header": _ros_header(start_ns + stamp)}
            for topic in info_topics[:-1]:
                messages.append((arrival, topic, info, calibration))
            messages.append((arrival, info_topics[-1], info, {**calibration, **told}))
        if ordered:
            messages.sort(key=lambda m: m[0])
        for arrival, topic, schema, message in messages:
            time = start_ns + arrival
            writer.write_message(topic, schema, message, log_time=time, publish_time=time)
        writer.finish()
    return path


#: Focal length of a camera of 640 px with a field of view of 75 deg [px].
FOCAL = 417.0321


def write_foxglove(path: Path, frames: Frames, wheels: Wheels, protobuf: bool) -> Path:
    """Write compressed images in JSON, with a calibration, or protobuf, and odometry as in our own logs."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        image_class, descriptors = _protobuf_image()
        if protobuf:
            schema = writer.register_schema("foxglove.CompressedImage", "protobuf", descriptors)
        else:
            schema = writer.register_schema("foxglove.CompressedImage", "jsonschema", b"{}")
        images = writer.register_channel("/camera", "protobuf" if protobuf else "json", schema)
        own = writer.register_schema("msrr.WheelOdometry", "jsonschema", b"{}")
        odometry = writer.register_channel("/wheels", "json", own)
        messages: list[tuple[int, int, bytes]] = []
        if not protobuf:
            known = writer.register_schema("foxglove.CameraCalibration", "jsonschema", b"{}")
            K = [FOCAL, 0.0, 319.5, 0.0, FOCAL, 239.5, 0.0, 0.0, 1.0]
            camera = {"width": 640, "height": 480, "distortion_model": "plumb_bob", "D": [], "K": K}
            messages.append((0, writer.register_channel("/info", "json", known), json.dumps(camera).encode()))
        for arrival, reading in wheels:
            text = {"unit": "a", "stamp_ns": reading.stamp_ns, "left": reading.left, "right": reading.right}
            messages.append((arrival, odometry, json.dumps(text).encode()))
        for stamp, arrival, pixels in frames:
            sec, nsec = divmod(stamp, NS_PER_S)
            if protobuf:
                message = image_class(data=png(pixels), format="png", frame_id="camera")
                message.timestamp.seconds, message.timestamp.nanos = sec, nsec
                messages.append((arrival, images, message.SerializeToString()))
            else:
                data = base64.b64encode(png(pixels)).decode()
                text = {
                    "timestamp": {"sec": sec, "nsec": nsec},
                    "frame_id": "c",
                    "data": data,
                    "format": "png",
                }
                messages.append((arrival, images, json.dumps(text).encode()))
        for arrival, channel, data in sorted(messages, key=lambda m: m[0]):
            writer.add_message(channel, log_time=arrival, publish_time=arrival, data=data)
        writer.finish()
    return path


def _protobuf_image() -> tuple[Any, bytes]:
    """Return the class of foxglove.CompressedImage, and the descriptors that its files carry."""
    time = FileDescriptorProto(name="t.proto", package="google.protobuf", syntax="proto3")
    stamp = time.message_type.add(name="Timestamp")
    stamp.field.add(name="seconds", number=1, type=FieldDescriptorProto.TYPE_INT64, label=1)
    stamp.field.add(name="nanos", number=2, type=FieldDescriptorProto.TYPE_INT32, label=1)
    image = FileDescriptorProto(name="i.proto", package="foxglove", syntax="proto3", dependency=["t.proto"])
    message = image.message_type.add(name="CompressedImage")
    message.field.add(
        name="timestamp",
        number=1,
        type=FieldDescriptorProto.TYPE_MESSAGE,
        type_name=".google.protobuf.Timestamp",
        label=1,
    )
    message.field.add(name="frame_id", number=4, type=FieldDescriptorProto.TYPE_STRING, label=1)
    message.field.add(name="data", number=2, type=FieldDescriptorProto.TYPE_BYTES, label=1)
    message.field.add(name="format", number=3, type=FieldDescriptorProto.TYPE_STRING, label=1)
    files = FileDescriptorSet(file=[time, image])
    pool = DescriptorPool()
    for file in files.file:
        pool.Add(file)
    found = pool.FindMessageTypeByName("foxglove.CompressedImage")
    return GetMessageClass(found), files.SerializeToString()
