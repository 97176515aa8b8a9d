"""What a robot makes of an error-free image of what was built, by the drawing that it was told.

The models of cameras without pixels use it for the systematic part of their errors: true corners are
projected by the true camera, and the poses are those that the software of the robot computes from them.
"""

from __future__ import annotations

from collections.abc import Mapping

from msrr_bullet.built_poses import camera_pose, overhead_camera_pose, placed_tags
from msrr_bullet.render.renderer import NEAR_M
from msrr_perception.pose.joint_pose import joint_pose
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.pose.target import TargetModel
from msrr_scenes.arrays import Array
from msrr_scenes.as_built import AsBuilt, BuiltCamera
from msrr_scenes.geometry.distortion import has_inverse, no_inverse
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import optical_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.messages import OVERHEAD, Detections, Exposure, TagDetection
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

Bearings = tuple[float | None, float | None]


class OnboardSight:
    """The sight of the target port by the onboard camera of a unit.

    Nothing hides a tag, and one that faces away from the camera is seen as if its print shone through.
    """

    def __init__(self, scene: Scene, built: AsBuilt, step: DockStep) -> None:
        """Prepare the true and the told geometry of a step.

        Raises:
            GeometryError: The lens that was built has no inverse in the frame.
        """
        drawn, tags = scene.geometry(step.target_unit), placed_tags(scene, built, step.target_unit)
        self._told = TargetModel.from_scene(scene.told(), step)
        self._camera = _TrueCamera(built.units[step.unit].camera)
        self._X_CU = optical_pose(camera_pose(scene, built, step.unit)).inverse()
        X_DT = SE3.from_se2(drawn.dock_frame(step.target_port)).inverse()
        self._corners_D = {
            tag.tag_id: (X_DT @ tag.X_BT).act(tag_corners(tag.size))
            for tag in (tags[slot] for slot in drawn.marker_slots(step.target_port))
        }

    def see(self, X_DU: SE2) -> tuple[SE2 | None, Bearings]:
        """Return the pose that the robot computes and the bearings (left, right) that it measures [rad].

        ``X_DU`` is the true pose. None stands for the pose if no tag of the port is in view as a whole, and
        for an edge out of view.
        """
        X_CD = self._X_CU @ SE3.from_se2(X_DU.inverse())
        tags = self._camera.tags(self._told.lens, X_CD, self._corners_D)
        pose = joint_pose(self._told, tags)
        seen = {tag.tag_id: tag.corners for tag in tags}
        left, right = (
            float(self._told.camera.bearing(seen[edge.tag_id][list(edge.corners), 0].mean()))
            if edge.tag_id in seen
            else None
            for edge in self._told.edges
        )
        return None if pose is None else pose.X_DU, (left, right)


class OverheadSight:
    """The sight of all bodies by the overhead camera."""

    def __init__(self, scene: Scene, built: AsBuilt) -> None:
        """Prepare the true and the told geometry of a scene with an overhead camera.

        Raises:
            GeometryError: The lens that was built has no inverse in the frame.
        """
        assert built.overhead is not None, "an overhead camera was built"
        model = OverheadModel.from_scene(scene.told(), ())
        self._localizer, self._tag_of, self._lens = model.localizer(), model.tag_of, model.lens
        self._camera = _TrueCamera(built.overhead)
        self._X_CW = overhead_camera_pose(scene, built).inverse()
        self._corners_B = {
            name: placed_tags(scene, built, name)["tag_top"].corners_B for name in model.tag_of
        }

    def see(self, name: str, X_WB: SE2) -> SE2 | None:
        """Return the pose that the robot computes of a body at ``X_WB``.

        It is None if the tag of the body is not in view, or does not look like that tag.
        """
        tag_id = self._tag_of[name]
        X_CB = self._X_CW @ SE3.from_se2(X_WB)
        tags = self._camera.tags(self._lens, X_CB, {tag_id: self._corners_B[name]})
        poses = self._localizer.locate(Detections(Exposure(OVERHEAD, 0, 0), tags, ()))
        return poses[0].X_WB if poses else None


class _TrueCamera:
    """A camera as it was built."""

    def __init__(self, built: BuiltCamera) -> None:
        if not has_inverse(built.pinhole, built.distortion):  # a renderer could not draw it either
            raise no_inverse(built.distortion, built.pinhole.frame)
        self._built = built
        self._lens = Lens(built.pinhole, built.distortion)

    def tags(self, told: Lens, X_CA: SE3, corners_A: Mapping[int, Array]) -> tuple[TagDetection, ...]:
        """Return the tags, given by their corners in A, that the camera sees as a whole.

        Their pixels are undistorted by the calibration that the robot is told.
        """
        tags = []
        for tag_id, corners in corners_A.items():
            p_C = X_CA.act(corners)
            if p_C[:, 2].min() > NEAR_M and self._lens.sees(p_C).all():
                tags.append(TagDetection(tag_id, told.undistorted(self._built.project(p_C))))
        return tuple(tags)
