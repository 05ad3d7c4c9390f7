"""The pictures on the cameras: composed for what is shown, at a modest size and pace."""

from collections.abc import Sequence

from numpy import uint8
from numpy.typing import NDArray

from studio.errors import StudioError
from studio.runs.overlay_pictures import ViewComposer
from studio.scene.camera_views import LONGEST_SIDE
from studio.scene.moment import Moment
from studio.scene.opened_run import OpenedRun
from studio.scene.view_options import ViewOptions
from studio.settings import RunSettings

Bytes = NDArray[uint8]


class ViewPictures:
    """Composes the pictures of all cameras of an opened run; the footage is opened with the first one asked
    for.
    """

    def __init__(self, opened: OpenedRun) -> None:
        self._opened = opened
        self._composer: ViewComposer | None = None
        self._settings: RunSettings | None = None
        self.problem = ""

    def use(self, settings: RunSettings) -> None:
        """Make masks and edge maps with these settings from now on."""
        self._settings = settings
        if self._composer is not None:
            self._composer.use(settings)

    def compose(
        self, moment: Moment, options: ViewOptions, limbs: Sequence[int], layer: int | None
    ) -> dict[str, Bytes]:
        """Camera name to picture (BGR, as stored, reduced); a camera whose picture cannot be made is left
        out, and `problem` says why.
        """
        frame = self._opened.span[0] if moment.frame is None else moment.frame
        records = [record for record in moment.records if layer in (None, record.layer)]
        found: dict[str, Bytes] = {}
        self.problem = ""
        for camera in self._opened.cameras:
            try:
                found[camera.name] = self._opened_composer().compose(
                    frame,
                    camera.name,
                    options.overlays,
                    pose=moment.pose,
                    clouds=records,
                    limbs=limbs,
                    height=round(camera.height * min(1.0, LONGEST_SIDE / max(camera.width, camera.height))),
                )
            except StudioError as problem:
                self.problem = str(problem)
        return found

    def close(self) -> None:
        """Let go of the footage."""
        if self._composer is not None:
            self._composer.close()
            self._composer = None

    def _opened_composer(self) -> ViewComposer:
        if self._composer is None:
            self._composer = ViewComposer(self._opened.session, self._opened.run, self._settings)
        return self._composer
