"""What a person wants to see, as one frozen value: swapped whole, never edited in place."""

from dataclasses import dataclass

from studio.runs.tracks import RAW


@dataclass(frozen=True, slots=True)
class ViewOptions:
    """The choices of the Show tab.

    body, body_opacity : the answer's cones. stored : the stored answer as a grey cage while a re-annealed
    one is shown. truth : the reference's stick figure. particles : the clouds. limbs : names of the limbs
    whose end points are drawn; None takes the extremities (limbs on which no other limb begins). colour_by
    : "layer" or "weight". point_size : metres. trails : paths of `trail_markers` (None: the extremities')
    over `trail_frames` frames before and after the shown one (0: all). cameras, pictures : frusta and the
    pictures on them. hull : the frame's visual hull as voxels. blobs : the blobs fitted to it beside the
    answer's own, in runs that are weighed by them. track : whose poses are drawn, of `runs.tracks`; the search's own
    stand beside as the grey cage. overlays : what is drawn over the pictures, of
    `runs.overlay_drawing.OVERLAYS`. dark : the theme.
    """

    body: bool = True
    body_opacity: float = 0.85
    stored: bool = True
    truth: bool = True
    particles: bool = True
    limbs: tuple[str, ...] | None = None
    colour_by: str = "layer"
    point_size: float = 0.012
    trails: bool = True
    trail_markers: tuple[str, ...] | None = None
    trail_frames: int = 60
    cameras: bool = True
    pictures: bool = True
    hull: bool = False
    blobs: bool = False
    track: str = RAW
    overlays: tuple[str, ...] = ("outline",)
    dark: bool = True


@dataclass(frozen=True, slots=True)
class Shown:
    """Which moment is shown. session, run : names ("" while none is open). frame : None while there is none.

    layer : one layer's cloud, None for all together. look_through : a camera's name, None for the free view.
    follow : the shown frame moves on with the tracking. editing : a pose is under a person's hands.
    """

    session: str = ""
    run: str = ""
    frame: int | None = None
    layer: int | None = None
    look_through: str | None = None
    follow: bool = True
    editing: bool = False
