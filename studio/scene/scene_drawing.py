"""All that stands in the scene of one opened run: made when it is opened, moved from then on."""

from collections.abc import Callable, Mapping

import numpy as np
import viser
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_ends
from studio.body.model import extremities
from studio.runs.colour_tokens import colour_tokens
from studio.runs.tracks import RAW
from studio.scene.body_view import BodyView
from studio.scene.camera_views import CameraViews
from studio.scene.floor_view import FloorView
from studio.scene.frame_volume import FrameVolume
from studio.scene.limb_meshes import METRES_PER_MM
from studio.scene.moment import Moment
from studio.scene.opened_run import OpenedRun
from studio.scene.particle_view import CloudStyle, ParticleView
from studio.scene.stick_figure import TruthView
from studio.scene.trail_view import TrailView
from studio.scene.view_options import ViewOptions
from studio.scene.volume_view import VolumeView
from studio.tracking.tracker import LOST, NO_EVIDENCE

Bytes = NDArray[np.uint8]

AWAY = (LOST, NO_EVIDENCE)
_VIEW_ELEVATION = 0.34
_LEAST_DISTANCE, _MOST_DISTANCE = 2.6, 9.0
_FIELD_OF_VIEW = 0.85
_DOUBTFUL = 0.35
"""Opacity of a body that is held where it was last seen, or that the tracker knows to be elsewhere."""
_EDITED = 0.6
"""Opacity of a body under a person's hands: what is behind a limb can be seen and taken hold of."""
_LOOK_HIGHER = np.array([0.0, 0.0, 0.2])


class SceneDrawing:
    """Used by the presenter's thread only."""

    def __init__(self, server: viser.ViserServer, opened: OpenedRun, dark: bool) -> None:
        tokens = colour_tokens(dark)
        self._server = server
        self._opened = opened
        self._dark = dark
        body = opened.body
        person = limb_ends(body, opened.start_pose()[None])[0].reshape(-1, 3).mean(axis=0)
        self.floor = FloorView(server, opened.cameras, person, tokens)
        self.body = BodyView(server, body, tokens, name="/body")
        self.beside = BodyView(server, body, tokens, name="/stored", ghost=True)
        self.particles = ParticleView(server, body)
        self.trails = TrailView(server, body)
        self.volume = VolumeView(server, body)
        self.cameras = CameraViews(server, opened.cameras, tokens)
        self.truth = TruthView(server, body, opened.truth.names, tokens) if opened.truth else None
        self._names = [limb.name for limb in body.drawn]

    def draw(
        self,
        moment: Moment,
        options: ViewOptions,
        layer: int | None,
        volume: FrameVolume | None = None,
    ) -> None:
        """Bring everything but the pictures to a moment, in one step for the viewers."""
        if options.dark != self._dark:
            self.recolour(options.dark)
        tokens = colour_tokens(options.dark)
        with self._server.atomic():
            most = _DOUBTFUL if moment.tracking in AWAY else _EDITED if moment.edited else 1.0
            opacity = min(options.body_opacity, most)
            self.body.show(moment.pose if options.body else None, opacity)
            self.beside.show(moment.beside if options.stored else None, 0.35)
            if self.truth is not None:
                self.truth.show(moment.truth if options.truth else None)
            if options.particles:
                self.particles.show(moment.records, self._cloud_style(moment, options, layer), tokens)
            else:
                self.particles.clear()
            self.trails.show(
                moment.frame, options.trail_markers, int(options.trail_frames), tokens, visible=options.trails
            )
            self.volume.show(volume, moment.pose, tokens, hull=options.hull, blobs=options.blobs)
            self.cameras.show(options.cameras, options.pictures)
            # Through a camera the floor is the one in the picture.
            self.floor.show(self.cameras.through is None)

    def hang(self, pictures: Mapping[str, Bytes]) -> None:
        """Hang new pictures (BGR, as stored or evenly reduced) on the cameras."""
        self.cameras.show_pictures(pictures)

    def recolour(self, dark: bool) -> None:
        """Take the colours of another theme."""
        self._dark = dark
        tokens = colour_tokens(dark)
        for part in (self.floor, self.body, self.beside, self.cameras, self.truth):
            if part is not None:
                part.recolour(tokens)

    def forget_poses(self) -> None:
        """Take the run's poses anew: some of them changed."""
        self.trails.clear()

    def read_poses(self, track: str = RAW) -> None:
        """Take a track's poses for the trails; only new ones are computed."""
        self.trails.set_poses(*self._opened.poses(track))

    def chosen_limbs(self, options: ViewOptions) -> tuple[int, ...]:
        """Indices of the drawn limbs whose ends carry particles."""
        if options.limbs is None:
            return extremities(self._opened.body)
        return tuple(index for index, name in enumerate(self._names) if name in options.limbs)

    def first_view(self, *, move_viewers: bool) -> None:
        """Where a viewer begins: in front of the person, between two cameras, a little above the eyes'
        height.
        """
        ends = limb_ends(self._opened.body, self._opened.start_pose()[None])[0] * METRES_PER_MM
        middle = (ends.min(axis=(0, 1)) + ends.max(axis=(0, 1))) / 2.0 + _LOOK_HIGHER
        height = float(np.ptp(ends[..., 2]))
        toward = self._toward(middle)
        reach = [
            float(np.linalg.norm(camera.centre * METRES_PER_MM - middle)) for camera in self._opened.cameras
        ]
        wanted = max(2.3 * height, 1.1 * float(np.mean(reach)) if reach else 0.0)
        distance = float(np.clip(wanted, _LEAST_DISTANCE, _MOST_DISTANCE))
        position = middle + distance * (toward + np.array([0.0, 0.0, _VIEW_ELEVATION]))
        view = self._server.initial_camera
        view.position, view.look_at, view.fov = position, middle, _FIELD_OF_VIEW
        if move_viewers:
            for client in self._server.get_clients().values():
                with client.atomic():
                    client.camera.position, client.camera.look_at = position, middle

    def on_camera_clicked(self, react: Callable[[str], None]) -> None:
        """Call `react` with a camera's name when it is clicked."""
        self.cameras.on_click(react)

    def remove(self) -> None:
        """Take everything out of the scene."""
        for part in (
            self.floor,
            self.body,
            self.beside,
            self.particles,
            self.trails,
            self.volume,
            self.cameras,
            self.truth,
        ):
            if part is not None:
                part.remove()

    def _toward(self, middle: NDArray[np.float64]) -> NDArray[np.float64]:
        """A level unit direction from the person towards the gap between the first camera and its
        neighbour.
        """
        centres = [camera.centre * METRES_PER_MM - middle for camera in self._opened.cameras]
        bearings = [float(np.arctan2(centre[1], centre[0])) for centre in centres]
        if not bearings:
            return np.array([1.0, 0.0, 0.0])
        gaps = [np.mod(bearing - bearings[0], 2.0 * np.pi) for bearing in bearings[1:]]
        half = min(gaps) / 2.0 if gaps and 0.2 < min(gaps) < 2.6 else 0.5
        bearing = bearings[0] + half
        return np.array([np.cos(bearing), np.sin(bearing), 0.0])

    def _cloud_style(self, moment: Moment, options: ViewOptions, layer: int | None) -> CloudStyle:
        return CloudStyle(
            self.chosen_limbs(options), options.colour_by, layer, moment.layer_count, options.point_size
        )
