"""All objects in the scene of an opened session or run: made when it is opened, then only moved."""

import time
from collections.abc import Callable, Sequence

import numpy as np
import viser

from studio.app.scene import METRES_PER_MM
from studio.app.scene.body_view import BodyView
from studio.app.scene.camera_views import LONGEST_SIDE, CameraViews
from studio.app.scene.floor_view import FloorView
from studio.app.scene.frame_volume import FrameVolumes, has_blobs
from studio.app.scene.line_views import TrailView, TruthView
from studio.app.scene.model import Ghost, Model
from studio.app.scene.opened_run import Moment, OpenedRun
from studio.app.scene.particle_view import CloudStyle, ParticleView
from studio.app.scene.search_view import SearchLook, SearchView
from studio.app.scene.volume_view import VolumeView
from studio.body.forward_kinematics import limb_ends
from studio.body.scale import scale_of
from studio.foundations.arrays import Array, Bytes
from studio.foundations.errors import StudioError
from studio.results.overlay_pictures import OtherBody, ViewComposer
from studio.runs.drawing.colour_tokens import ColourTokens
from studio.search.trackers.tracker import LOST, NO_EVIDENCE

DOUBTFUL, EDITED, STORED, GHOST, GLASS = 0.35, 0.6, 0.35, 0.6, 0.16
"""Opacity of a body that is held or known to be lost, of one being edited (so that handles behind a limb can be
grasped), of the stored result beside another, of bodies that were asked for beside the answer, and of one whose layers
are looked at: nothing of their clouds is covered."""
LOOKED_AT_SIZE = 2.0
"""Width of the points of a layer that is looked at, beside those of all layers together."""
TRAIL_SECONDS = 1.0
EVERY_FRAME = 2**40
"""The reach of trails over the whole run."""
_VIEW_ELEVATION = 0.34
_ASKANCE = 0.7
"""Radians from straight ahead, where there are no cameras: what is longer than high is seen at its length."""
_LEAST_DISTANCE, _MOST_DISTANCE = 2.6, 9.0
_FIELD_OF_VIEW = 0.85
_LOOK_HIGHER = np.array([0.0, 0.0, 0.2])


class SceneViews:
    """Draws a model of an opened run. Used by the scene's thread only.

    clicked, limb_clicked : called with the name of a camera, and whether it was clicked twice, or of a limb,
    and where in the view.
    volume_made, failed : called when a hull was made, or with the reason why it cannot be. All are called in other
    threads.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        opened: OpenedRun,
        *,
        clicked: Callable[[str, bool], None] = lambda camera, twice: None,
        limb_clicked: Callable[[str, tuple[float, float]], None] = lambda limb, at: None,
        volume_made: Callable[[], None] = lambda: None,
        failed: Callable[[StudioError], None] = lambda _: None,
    ) -> None:
        self._server, self._opened = server, opened
        body, centres = opened.body, [camera.centre for camera in opened.cameras]
        self._person = limb_ends(body, opened.start_pose()[None])[0].reshape(-1, 3)
        self.floor = FloorView(server, [*centres, self._person.mean(axis=0)], scale_of(body))
        self.body = BodyView(server, body, name="/body", clicked=limb_clicked)
        self.beside = BodyView(server, body, name="/stored", ghost=True)
        self.ghosts: list[BodyView] = []
        self.particles = ParticleView(server, body)
        self.search = SearchView(server, body, self.particles)
        self.trails = TrailView(server, body)
        self.volume = VolumeView(server, body)
        self.cameras = CameraViews(server, opened.cameras, clicked)
        self.truth = TruthView(server, body, opened.truth.names if opened.truth else ())
        self._volumes = FrameVolumes(opened, volume_made, failed)
        self._composer: ViewComposer | None = None
        self._trails_of: tuple[tuple[str, int], tuple[int, ...]] = ("", 0), ()
        self._trails_read, self._trails_between = float("-inf"), (0, 0)

    def close(self) -> None:
        """Release footage and threads; what is drawn stays until the scene is cleared."""
        self._volumes.close()
        if self._composer is not None:
            self._composer.close()

    def show(self, model: Model, moment: Moment, tokens: ColourTokens) -> None:
        """Draw everything but the pictures, as one update for the viewers."""
        subject, knobs, options = model.subject, model.knobs, model.options
        if subject is None or knobs is None:
            return
        if options.trails and moment.frame is not None:
            self._read_trails(model, moment.frame)
        wanted = options.hull or (options.blobs and has_blobs(knobs.settings))
        volume = self._volumes.of(moment, knobs.settings, blobs=options.blobs) if wanted else None
        doubtful = moment.tracking in (LOST, NO_EVIDENCE)
        looks = model.is_looking_at_layers
        most = GLASS if looks else DOUBTFUL if doubtful else EDITED if moment.edited else 1.0
        limbs, size = subject.chosen_limbs(options), options.point_size * (LOOKED_AT_SIZE if looks else 1.0)
        style = CloudStyle(
            limbs, options.colour_by, model.selection.layer, moment.layer_count, size, glows=looks
        )
        # Paths over frames lie on the clouds of hands and feet.
        has_trails = options.trails and not looks
        markers = subject.listed("trail_markers", options) if has_trails else ()
        through = model.selection.look_through
        is_free = through is None
        with self._server.atomic():
            opacity, limb = min(options.body_opacity, most), model.selection.limb
            # Through a camera the body is the outline in the picture.
            own = moment.pose if options.body and is_free and model.trial is None else None
            self.body.show(own, tokens, opacity, limb)
            self.beside.show(moment.beside if options.stored and is_free else None, tokens, STORED)
            self._show_ghosts((*(model.ghosts if is_free else ()), *chosen_particle(model, moment)), tokens)
            self.truth.show(moment.truth if options.truth else None, tokens)
            self.particles.show(moment.records if options.particles else (), style, tokens)
            self._show_search(model, moment, limbs, size, tokens)
            self.trails.show(moment.frame, markers, int(options.trail_frames), tokens)
            self.volume.show(volume, moment.pose, tokens, hull=options.hull, blobs=options.blobs)
            self.cameras.show(tokens, options.cameras, options.pictures, through)
            # Through a camera the floor is the one in the picture.
            self.floor.show(tokens, is_free, options.shadows)

    def _show_search(
        self, model: Model, moment: Moment, limbs: tuple[int, ...], size: float, tokens: ColourTokens
    ) -> None:
        options, selection = model.options, model.selection
        names = [self.body.limb_of[limb.name] for limb in self._opened.body.drawn]
        own = [at for at, name in enumerate(names) if name == selection.limb]
        look = SearchLook(
            limbs,
            moment.layer_count,
            size,
            options.shells,
            options.skeletons,
            selection.particle if model.pointed is None else model.pointed,
            tuple(own[-1:]) if options.lines else (),
        )
        layer = selection.layer if model.is_looking_at_layers else None
        self.search.show(moment.records, layer, look, tokens, model.layers.phase)

    def travel(self, phase: float) -> None:
        """Move the particles of the layer that is looked at to where they are after a share of its time."""
        with self._server.atomic():
            self.search.travel(phase)

    def _show_ghosts(self, ghosts: Sequence[Ghost], tokens: ColourTokens) -> None:
        """Draw bodies beside the answer; their meshes are made when they are first needed."""
        for at in range(len(self.ghosts), len(ghosts)):
            self.ghosts.append(BodyView(self._server, self._opened.body, name=f"/beside/{at}", ghost=True))
        for at, view in enumerate(self.ghosts):
            ghost = ghosts[at] if at < len(ghosts) else None
            if ghost is not None:
                view.colour = ghost.colour
            view.show(None if ghost is None else ghost.pose, tokens, GHOST)

    def hang_pictures(self, model: Model, moment: Moment, tokens: ColourTokens) -> None:
        """Compose the pictures of a moment and hang them on the cameras; one that cannot be made stays unchanged."""
        subject, knobs, options, selection = model.subject, model.knobs, model.options, model.selection
        if subject is None or knobs is None or not (options.pictures or selection.look_through):
            return
        trial = model.trial
        # While layers are played the pictures are not composed for each.
        alone = None if model.layers.playing else selection.layer
        records = [record for record in moment.records if alone in (None, record.layer)]
        pictures: dict[str, Bytes] = {}
        # Beside a frame that is annealed again stands the stored result, beside a compared run the others.
        others = [] if moment.beside is None else [OtherBody(moment.beside, "stored")]
        others += [OtherBody(ghost.pose, ghost.colour) for ghost in model.ghosts]
        own = "" if moment.beside is None else "tried"
        series = {ghost.colour for ghost in model.ghosts if ghost.colour.startswith("series")}
        if series and not own:
            # Compared runs have one colour each: this one has what the others leave.
            own = next(f"series-{at}" for at in range(len(series) + 1) if f"series-{at}" not in series)
        for camera in self._opened.cameras:
            is_behind = camera.name == selection.look_through
            overlays = (*options.overlays, "outline") if is_behind else options.overlays
            shrink = min(1.0, LONGEST_SIDE / max(camera.width, camera.height))
            try:
                if self._composer is None:
                    self._composer = ViewComposer(self._opened.session, self._opened.run)
                if self._opened.run is not None:
                    self._composer.use(knobs.settings)
                pictures[camera.name] = self._composer.compose(
                    subject.span[0] if moment.frame is None else moment.frame,
                    camera.name,
                    tuple(dict.fromkeys(overlays)),
                    pose=moment.pose if trial is None else trial.pose,
                    body=None if trial is None else trial.body,
                    clouds=records,
                    limbs=subject.chosen_limbs(options),
                    height=round(camera.height * shrink),
                    beside=others,
                    own=own,
                )
            except StudioError:
                continue
        with self._server.atomic():
            self.cameras.hang(pictures)
            self.cameras.show(tokens, options.cameras, options.pictures, selection.look_through)

    def look_at_person(self, *, move_viewers: bool) -> None:
        """Set the first view: in front of the person, between two cameras, a little above eye height."""
        position, middle = first_view(
            self._person * METRES_PER_MM,
            [camera.centre * METRES_PER_MM for camera in self._opened.cameras],
            scale_of(self._opened.body),
        )
        view = self._server.initial_camera
        view.position, view.look_at, view.fov = position, middle, _FIELD_OF_VIEW
        for client in self._server.get_clients().values() if move_viewers else ():
            with client.atomic():
                client.camera.position, client.camera.look_at = position, middle

    def _read_trails(self, model: Model, frame: int) -> None:
        """Take the poses of the shown track about a frame, twice as far as they are drawn: again once it is beyond
        them, or they changed, and that not too often.
        """
        track, frames, now = self._opened.track_key(model.options.track), model.frames, time.monotonic()
        reach = int(model.options.trail_frames) or EVERY_FRAME
        near = self._trails_between[0] <= frame - reach and frame + reach <= self._trails_between[1]
        is_due = frames is not self._trails_of[1] and now - self._trails_read >= TRAIL_SECONDS
        if track != self._trails_of[0] or not near or is_due:
            self._trails_between = frame - 2 * reach, frame + 2 * reach
            self.trails.set_poses(*self._opened.poses(track[0], self._trails_between))
            self._trails_of, self._trails_read = (track, frames), now


def chosen_particle(model: Model, moment: Moment) -> tuple[Ghost, ...]:
    """The chosen particle of the shown layer (of the last one where all are shown), as a body beside the answer."""
    chosen, layer = model.selection.particle, model.selection.layer
    record = next((one for one in reversed(moment.records) if layer in (None, one.layer)), None)
    if chosen is None or record is None or chosen >= len(record.poses):
        return ()
    return (Ghost(record.poses[chosen], "accent"),)


def first_view(person: Array, cameras: list[Array], scale: float = 1.0) -> tuple[Array, Array]:
    """A place to look from (3,) and at (3,), metres. person : (K, 3) its limbs' ends. cameras : their centres (3,).
    scale : of the body beside a person.
    """
    middle = (person.min(axis=0) + person.max(axis=0)) / 2.0 + scale * _LOOK_HIGHER
    height = float(np.ptp(person[:, 2]))
    away = [float(np.linalg.norm(centre - middle)) for centre in cameras]
    wanted = max(2.3 * height, 1.1 * float(np.mean(away)) if away else 0.0)
    distance = float(np.clip(wanted, scale * _LEAST_DISTANCE, scale * _MOST_DISTANCE))
    # Towards the gap between the first camera and its neighbour.
    bearings = [float(np.arctan2(centre[1] - middle[1], centre[0] - middle[0])) for centre in cameras]
    gaps = [np.mod(other - bearings[0], 2.0 * np.pi) for other in bearings[1:]]
    half = min(gaps) / 2.0 if gaps and 0.2 < min(gaps) < 2.6 else 0.5
    bearing = bearings[0] + half if bearings else _ASKANCE
    toward = np.array([np.cos(bearing), np.sin(bearing), _VIEW_ELEVATION])
    return middle + distance * toward, middle
