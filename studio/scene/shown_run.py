"""One opened run as it stands in the scene: its data, its handles, its pictures, its settings."""

import time
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from studio.errors import StudioError
from studio.knobs import Value
from studio.runs.tracks import RAW
from studio.scene.frame_volume import FrameVolumes, has_blobs
from studio.scene.live_search import LiveSearch
from studio.scene.moment import Moment, moment_of
from studio.scene.opened_run import OpenedRun
from studio.scene.scene_drawing import SceneDrawing
from studio.scene.view_options import ViewOptions
from studio.scene.view_pictures import ViewPictures
from studio.settings import changed_settings

Array = NDArray[np.float64]

_TRAIL_SECONDS = 1.0


class ShownRun:
    """Used by the presenter's thread only; `frames` is replaced whole and may be read by any."""

    def __init__(
        self,
        drawing: SceneDrawing,
        opened: OpenedRun,
        volume_made: Callable[[], None] = lambda: None,
        failed: Callable[[StudioError], None] = lambda _: None,
    ) -> None:
        """volume_made, failed : called from another thread, when a hull was made or why it could not be."""
        self.drawing, self.opened = drawing, opened
        self.pictures = ViewPictures(opened)
        self.volumes = FrameVolumes(opened, volume_made, failed)
        self.settings = opened.settings()
        self.frames: tuple[int, ...] = tuple(opened.frames())
        self._trails_read = float("-inf")
        self._trails_stale = True
        self._trails_of: tuple[str, int] = (RAW, 0)

    def moment(self, frame: int | None, live: LiveSearch, edited: Array | None, track: str = RAW) -> Moment:
        """What there is to draw at a frame."""
        return moment_of(self.opened, frame, live, edited=edited, layers=self._layers_wanted, track=track)

    def layer_count(self, frame: int | None, live: LiveSearch) -> int:
        """How many layers the shown frame takes."""
        return self.moment(frame, live, None).layer_count

    def draw(self, moment: Moment, options: ViewOptions, layer: int | None) -> None:
        """Bring everything but the pictures to a moment."""
        self._keep_trails(options)
        wanted = options.hull or (options.blobs and self.has_blobs)
        volume = self.volumes.of(moment, self.settings, blobs=options.blobs) if wanted else None
        self.drawing.draw(moment, options, layer, volume)

    def _keep_trails(self, options: ViewOptions) -> None:
        """Take the poses of the track that is shown, once they changed and not too often."""
        if not options.trails:
            return
        now, track = time.monotonic(), self.opened.track_key(options.track)
        if track != self._trails_of:
            self.drawing.forget_poses()
            self._trails_of, self._trails_stale, self._trails_read = track, True, float("-inf")
        if self._trails_stale and now - self._trails_read >= _TRAIL_SECONDS:
            self.drawing.read_poses(track[0])
            self._trails_read, self._trails_stale = now, False

    def hang(self, moment: Moment, options: ViewOptions, layer: int | None) -> None:
        """Compose the pictures of a moment and hang them on the cameras."""
        limbs = self.drawing.chosen_limbs(options)
        self.drawing.hang(self.pictures.compose(moment, options, limbs, layer))

    def apply(self, values: Mapping[str, Value]) -> None:
        """Take settings that came into use."""
        self.settings = changed_settings(self.settings, values)
        self.pictures.use(self.settings)

    def frame_finished(self, frame: int) -> None:
        """Take note of a new stored result."""
        self.opened.forget_from(frame)
        newest = self.frames[-1] if self.frames else self.opened.span[0] - 1
        if frame == newest + 1:
            self.frames = (*self.frames, frame)
        else:
            # The newest event wins, so some frames were not heard of; or this one took the place of an older
            # answer, and what had followed from that was dropped.
            self.frames = tuple(self.opened.frames())
            if frame <= newest:
                self.drawing.forget_poses()
        self._trails_stale = True

    def close(self) -> None:
        """Take the run out of the scene and let go of its files."""
        self.drawing.remove()
        self.pictures.close()
        self.volumes.close()
        self.opened.close()

    @property
    def has_blobs(self) -> bool:
        """Whether the run is weighed by blobs."""
        return self.opened.run is not None and has_blobs(self.settings)

    @property
    def _layers_wanted(self) -> int:
        return int(getattr(self.settings.tracker, "layers", 1))
