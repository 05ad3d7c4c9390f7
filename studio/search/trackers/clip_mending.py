"""What a tracked clip shows as a whole and no frame alone: an animal that points backwards for some frames is turned
back (`turning_back`), exchanged sides, left and right, front and back, are put right (`side_exchange`), and doubtful
limbs are bridged from both ends (`limb_bridging`). Bridged first, exchanged legs are put right piece by piece.
"""

from collections.abc import Collection, Sequence

from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Indices
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.search.trackers.clip_silhouettes import SilhouettesOf
from studio.search.trackers.limb_bridging import with_limbs_bridged
from studio.search.trackers.refinement import RefinementSettings
from studio.search.trackers.side_exchange import with_sides_right
from studio.search.trackers.turning_back import with_facing_right


def mended_clip(
    body: BodyModel,
    cameras: Sequence[Camera],
    frames: Indices,
    poses: Array,
    named: Sequence[Sequence[str]],
    fps: float,
    silhouettes_of: SilhouettesOf,
    settings: RefinementSettings,
    progress: Progress = no_progress,
    kept: Collection[str] = (),
) -> tuple[Array, tuple[str, ...]]:
    """The clip's poses (K, D) mended, and what was changed, a line each; other frames keep their poses.

    frames : (K,) ascending. poses : (K, D). named : of each frame the limbs that the tracker called lost. settings : of
    the descents. progress : the step at hand; its exception ends the work. kept : limbs that are not
    bridged, as lines in the pictures were followed (`thin_limbs`). Raises what `silhouettes_of` raises.
    """
    progress("looking for turns", 0, 0)
    faced, turns = with_facing_right(body, cameras, frames, poses, fps, silhouettes_of, settings)
    corrected, changes = with_sides_right(
        body, cameras, frames, faced, fps, silhouettes_of, settings, progress
    )
    bridged, bridges = with_limbs_bridged(
        body, cameras, frames, corrected, named, fps, silhouettes_of, settings, progress, kept
    )
    return bridged, tuple(one.words for one in (*turns, *changes, *bridges))
