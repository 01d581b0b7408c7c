"""What a page shows of a walk: the robot, the ground around it, and the heights that it feels."""

from __future__ import annotations

import numpy as np
import trimesh
import viser
from mjviser import ViserMujocoScene
from numpy.typing import NDArray

from mute.envs.picture import Picture
from mute.evaluation.session import Session
from mute.rendering.height_dots import HeightDots

__all__ = ["PageScene"]

_CAMERA = (1.1, -1.4, 0.6)
"""Where a reader looks from at first, beside the robot, m."""
_DOT = 0.02
"""Size of a dot, m."""


class PageScene:
    """Robot 0 of a walk in a page; the camera goes with it."""

    def __init__(
        self, server: viser.ViserServer, session: Session, dots: HeightDots | None = None
    ) -> None:
        """Draw it as it stands.

        Args:
            server: Serves the page.
            session: The walk.
            dots: Heights to draw as dots.
        """
        self._server, self._session, self._dots = server, session, dots
        self._picture = picture = Picture(session.env)
        picture.show(0)
        boxes = picture.ground_boxes
        picture.model.geom_rgba[boxes, 3] = 0.0  # mjviser leaves out what cannot be seen
        self._robot = ViserMujocoScene(server, picture.model, 1)
        # Of all that stands still; mjviser moves it under the robot, which stays in the middle.
        self._world = self._robot.fixed_bodies_frame.name
        self._ground = _Ground(server, self._world, picture) if boxes else None
        self._cloud = self._add_cloud(dots) if dots is not None else None
        server.initial_camera.position, server.initial_camera.look_at = _CAMERA, (0.0, 0.0, 0.0)
        self._robot.update_from_mjdata(picture.data)

    def update(self) -> None:
        """Draw it as it stands now."""
        laid = self._picture.show(0)
        with self._server.atomic():
            if laid and self._ground is not None:
                self._ground.update()
            self._robot.update_from_mjdata(self._picture.data)
            if self._cloud is not None and self._dots is not None:
                self._dots.controller = self._session.controller
                self._cloud.points, self._cloud.colors = _drawn(self._dots)

    def _add_cloud(self, dots: HeightDots) -> viser.PointCloudHandle:
        points, colours = _drawn(dots)
        # Half precision would be too coarse some metres from where it began.
        return self._server.scene.add_point_cloud(
            f"{self._world}/heights", points, colours, point_size=_DOT, precision="float32"
        )


def _drawn(dots: HeightDots) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Return dots as viser has them. Shapes: (dots, 3) each."""
    places, colours = dots.points()
    return places.astype(np.float32), (255.0 * colours).astype(np.uint8)


class _Ground:
    """The boxes of the ground as one mesh in many places, which are moved as the robot walks.

    mjviser bakes what does not move into meshes of its own, and takes half a second to do so.
    """

    def __init__(self, server: viser.ViserServer, world: str, picture: Picture) -> None:
        """Draw the boxes as they lie, in the frame of the world of that name."""
        self._model, self._boxes = picture.model, picture.ground_boxes
        cube = trimesh.creation.box((2.0, 2.0, 2.0))  # scaled by half sizes
        colours = (255.0 * self._model.geom_rgba[self._boxes, :3]).astype(np.uint8)
        self._handle = server.scene.add_batched_meshes_simple(
            f"{world}/ground",
            cube.vertices,
            cube.faces,
            batched_wxyzs=self._model.geom_quat[self._boxes],
            batched_positions=self._model.geom_pos[self._boxes],
            batched_scales=self._model.geom_size[self._boxes],
            batched_colors=colours,
            flat_shading=True,
            lod="off",
            cast_shadow=False,
        )

    def update(self) -> None:
        """Draw the boxes as they lie now."""
        self._handle.batched_positions = self._model.geom_pos[self._boxes]
        self._handle.batched_wxyzs = self._model.geom_quat[self._boxes]
        self._handle.batched_scales = self._model.geom_size[self._boxes]
