"""The model of a window's scene, one immutable value, and all its changes, plain functions.

Every event (a moved control, a request of the page, a report of the tracking process, passing time) is a function
`change(model, *values) -> Model`. Nothing here reads files, uses viser or a clock: the controller does, in one thread,
and the views draw the model.
"""

import bisect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

from studio.app.scene.pose_edit import PoseEdit, ended
from studio.body.dragging import Dragger
from studio.body.mirroring import Mirror
from studio.body.model import BodyModel, extremities
from studio.foundations.arrays import Array
from studio.foundations.knobs import Value
from studio.operations.jobs.events import (
    Event,
    FrameFinished,
    LayerFinished,
    RunState,
    SettingsApplied,
    StateChanged,
)
from studio.runs.drawing.marker_lines import extremity_markers
from studio.runs.tracks import RAW
from studio.search.settings import RunSettings, all_knobs, changed_settings, values
from studio.search.trackers.tracker import FrameResult, LayerRecord

NEAR_THE_END = 3
"""A viewer who goes to one of the last frames while more are tracked keeps following."""
REMEMBERED = 256
STEP_RATE = 2.0
"""Layers a second by which particles travel to a layer that is chosen by hand."""
MOST_LATE = 0.5
"""Of a layer's time that one which is shown late may begin with; what is later still is not caught up."""


@dataclass(frozen=True, slots=True)
class Selection:
    """The selection of a window. session, run : names, "" while none is open. frame : None while there is none.

    layer : one layer's cloud, None for all together. limb, parameter, camera : names. particle : a row of the layer's
    cloud. look_through : the camera whose place the viewers take, None for the free view. eye : from where a viewer
    looks freely, place and what is looked at (6,) metres, None for the usual place. follow : the frame moves on with
    the tracking. editing : whether a pose is edited. request_number : of the page's request that this answers.
    """

    session: str = ""
    run: str = ""
    frame: int | None = None
    layer: int | None = None
    limb: str | None = None
    parameter: str | None = None
    particle: int | None = None
    camera: str | None = None
    look_through: str | None = None
    eye: tuple[float, ...] | None = None
    follow: bool = True
    editing: bool = False
    request_number: int = 0


@dataclass(frozen=True, slots=True)
class ViewOptions:
    """The choices of the Show tab and of the page.

    body, body_opacity : the answer's cones. trials : a frame that is annealed again, in the place of the stored one.
    stored : the stored result as a grey cage beside it.
    truth : the reference's stick figure. particles : the clouds, at the far ends of `limbs` (names; None: the
    extremities'), coloured by "layer" or "weight". point_size : metres. trails : paths of `trail_markers` (None: the
    extremities') over `trail_frames` frames before and after the shown one (0: all). cameras, pictures : frusta and
    the pictures on them. hull : the frame's visual hull as voxels. blobs : the blobs fitted to it beside the answer's
    own, in runs that are weighed by them. track : whose poses are drawn, of `runs.tracks`; the search's own stand
    beside as the grey cage. overlays : of `runs.drawing.overlay_drawing.OVERLAYS`. dark : the theme.
    shells : the layers before the one that is looked at, as small points. skeletons : stick figures of its heaviest
    particles. lines : the ways of the chosen limb's particles through the layers.
    follows_body : viewers go along with it from frame to frame.
    shadows : cast by the body, and light reflected by its surroundings: what a browser without a graphics card draws
    slowest.
    """

    body: bool = True
    body_opacity: float = 0.85
    trials: bool = True
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
    shells: bool = True
    skeletons: bool = True
    lines: bool = False
    hull: bool = False
    blobs: bool = False
    track: str = RAW
    overlays: tuple[str, ...] = ("outline",)
    dark: bool = True
    follows_body: bool = False
    shadows: bool = True


@dataclass(frozen=True, slots=True)
class Playback:
    """speed : 1 is real time. loop : start over at the end. debt : shown time that is no whole frame yet, in frames."""

    playing: bool = False
    speed: float = 1.0
    loop: bool = True
    debt: float = 0.0


LOOP, PING_PONG = "loop", "pingpong"
LAYER_MODES = LOOP, PING_PONG


@dataclass(frozen=True, slots=True)
class LayerPlayback:
    """Playing the shown frame's layers. rate : layers a second. mode : start over after the last layer, or turn back.

    phase : how much of the shown layer's time has passed, 0..1: its particles travel from their parents' places to
    their own. backwards : the way back of a ping-pong, on which the phase falls.
    """

    playing: bool = False
    rate: float = 3.0
    mode: str = LOOP
    phase: float = 1.0
    backwards: bool = False

    @property
    def state(self) -> tuple[bool, float, str]:
        """The choices: all but where it is."""
        return self.playing, self.rate, self.mode


@dataclass(frozen=True, slots=True, eq=False)
class LiveSearch:
    """The layers so far of the frame in progress, or of one that is annealed again.

    frame : None while there is none. reannealed : a what-if beside the stored result. result : None until the
    frame is finished.
    """

    frame: int | None = None
    reannealed: bool = False
    records: tuple[LayerRecord, ...] = ()
    result: FrameResult | None = None

    @property
    def pose(self) -> Array | None:
        """(D,) the pose so far: the result's, else the mean of the newest layer."""
        if self.result is not None:
            return self.result.estimate.pose
        return self.records[-1].mean if self.records else None

    @property
    def is_whole(self) -> bool:
        """Whether the result is there, and every layer of it."""
        return self.result is not None and len(self.records) == self.result.layers


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """An open session, or a run of it. span : its frames, half open. mirror : None for a body without sides."""

    body: BodyModel
    cameras: tuple[str, ...]
    span: tuple[int, int]
    fps: float
    dragger: Dragger
    mirror: Mirror | None

    def chosen_limbs(self, options: ViewOptions) -> tuple[int, ...]:
        """Indices of the drawn limbs whose far ends carry particles."""
        if options.limbs is None:
            return extremities(self.body)
        return tuple(at for at, limb in enumerate(self.body.drawn) if limb.name in options.limbs)

    def listed(self, name: str, options: ViewOptions) -> tuple[str, ...]:
        """The names that the option "limbs", "trail_markers" or "overlays" stands for."""
        chosen = getattr(options, name)
        if chosen is not None:
            return chosen
        if name == "limbs":
            return tuple(self.body.drawn[at].name for at in extremities(self.body))
        return extremity_markers(self.body)


@dataclass(frozen=True, slots=True, eq=False)
class Knobs:
    """settings : in use. since : the frame and layer since which, None as the run began.

    requested : changes waiting for the tracking process's answer, by identifier, oldest first. drafts : refused text
    that stays in its field, so that it can be completed.
    """

    settings: RunSettings
    since: tuple[int, int] | None = None
    requested: Mapping[str, Mapping[str, Value]] = field(default_factory=dict[str, Mapping[str, Value]])
    drafts: Mapping[str, Value] = field(default_factory=dict[str, Value])

    @property
    def shown(self) -> dict[str, Value]:
        """What the controls show: the newest request, else what is in use."""
        merged = {**values(self.settings), **self.drafts}
        for changes in self.requested.values():
            merged |= changes
        return merged


@dataclass(frozen=True, slots=True, eq=False)
class Ghost:
    """A body beside the answer, as a cage. pose : (D,) radians and mm. colour : a token."""

    pose: Array
    colour: str


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """A body that is being made, at a pose (D,): it stands in place of the session's own, or alone."""

    body: BodyModel
    pose: Array


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """Everything that a scene shows. search : state of the tracking process. subject, knobs, edit : None while nothing
    is open. frames : the stored ones, ascending. ghosts : bodies beside the answer, of the shown frame. trial : a body
    that is being made. pointed : the particle of the shown layer that a viewer's pointer is on, a row of its cloud.
    """

    search: StateChanged
    selection: Selection = Selection()
    options: ViewOptions = ViewOptions()
    playback: Playback = Playback()
    layers: LayerPlayback = LayerPlayback()
    live: LiveSearch = LiveSearch()
    subject: Subject | None = None
    frames: tuple[int, ...] = ()
    knobs: Knobs | None = None
    edit: PoseEdit | None = None
    ghosts: tuple[Ghost, ...] = ()
    trial: Trial | None = None
    pointed: int | None = None

    @property
    def is_looking_at_layers(self) -> bool:
        """Whether a single layer's cloud is shown or layers are played: the body is of glass then."""
        chosen = self.layers.playing or self.selection.layer is not None
        return chosen and self.options.particles and self.edited_pose is None

    @property
    def is_searching(self) -> bool:
        """Whether frames are being tracked, of whatever run."""
        return self.search.state.searches

    @property
    def is_searched(self) -> bool:
        """Whether the tracking process has the shown run open."""
        return (self.search.session, self.search.run) == (self.selection.session, self.selection.run)

    @property
    def edited_pose(self) -> Array | None:
        """(D,) the pose that is edited, None while none is."""
        return self.edit.pose if self.edit is not None and self.edit.active else None


def same_drawing(one: Model, other: Model) -> bool:
    """Whether two models are drawn alike: while a stored run is shown, how the search of another one goes is not."""
    others = (entry.name for entry in fields(Model) if entry.name != "search")
    searches = [
        one.is_searched,
        other.is_searched,
        *(model.search.state is RunState.LOST for model in (one, other)),
    ]
    return (
        one.subject is not None
        and not any(searches)
        and all(getattr(one, name) is getattr(other, name) for name in others)
    )


def same_pictures(one: Model, other: Model) -> bool:
    """Whether the pictures on the cameras of two models are the same; layers as they come are not drawn on them."""
    return (
        (_pictured(one), one.options) == (_pictured(other), other.options)
        and one.layers.playing == other.layers.playing
        and one.subject is other.subject
        and one.frames is other.frames
        and one.edit is other.edit
        and one.ghosts is other.ghosts
        and one.trial is other.trial
        and one.live.result is other.live.result
        and (one.knobs and one.knobs.settings) is (other.knobs and other.knobs.settings)
    )


def _pictured(model: Model) -> Selection:
    """What the pictures show of the selection: while layers are played the clouds of all."""
    layer = None if model.layers.playing else model.selection.layer
    return replace(model.selection, eye=None, layer=layer)


def same_panel(one: Model, other: Model) -> bool:
    """Whether the panel shows the same: layers that are played pass it by."""
    passing = {"layer": None, "particle": None, "limb": None, "eye": None, "request_number": 0}
    return replace(one.selection, **passing) == replace(other.selection, **passing) and all(
        getattr(one, entry.name) is getattr(other, entry.name)
        for entry in fields(Model)
        if entry.name not in ("selection", "layers", "pointed")
    )


def only_phase_differs(one: Model, other: Model) -> bool:
    """Whether nothing but how far a layer's particles have travelled differs."""
    return one.layers.state == other.layers.state and all(
        getattr(one, entry.name) is getattr(other, entry.name)
        for entry in fields(Model)
        if entry.name != "layers"
    )


# What is selected, and what is shown of it.


def opened(
    model: Model,
    session: str,
    run: str,
    subject: Subject | None,
    frames: Sequence[int] = (),
    settings: RunSettings | None = None,
    edit: PoseEdit | None = None,
) -> Model:
    """Another session or run is open: its newest frame is shown. subject : None where there is nothing to draw."""
    # Refusals of earlier requests are still reported; their values are of another run.
    requested: Mapping[str, Mapping[str, Value]] = (
        {} if model.knobs is None else {key: {} for key in model.knobs.requested}
    )
    return replace(
        model,
        selection=Selection(
            session, run, frames[-1] if frames else None, follow=model.selection.follow, editing=False
        ),
        playback=replace(model.playback, playing=False),
        layers=replace(model.layers, playing=False, phase=1.0, backwards=False),
        live=LiveSearch(),
        subject=subject,
        frames=tuple(frames),
        knobs=None if settings is None else Knobs(settings, requested=requested),
        edit=edit,
        ghosts=(),
        trial=None,
    )


def select(model: Model, **changes: object) -> Model:
    """Change the selection by the names of `Selection`. A particle is one of a frame's layer and goes with it."""
    if {"frame", "layer"} & changes.keys():
        changes = {"particle": None} | changes
    after = replace(model.selection, **changes)
    if after == model.selection:
        return model
    is_same = after.frame == model.selection.frame
    pointed = model.pointed if is_same and after.layer == model.selection.layer else None
    return replace(model, selection=after, ghosts=model.ghosts if is_same else (), pointed=pointed)


def discard_what_if(model: Model) -> Model:
    """Forget the frame that was annealed again: the stored result is shown."""
    return replace(model, live=LiveSearch()) if model.live.reannealed else model


def show_ghosts(model: Model, ghosts: Sequence[Ghost]) -> Model:
    """Draw bodies beside the answer until another frame is shown; those of another body are left out."""
    size = 0 if model.subject is None else len(model.subject.body.parameters)
    return replace(model, ghosts=tuple(ghost for ghost in ghosts if len(ghost.pose) == size))


def show_frame(model: Model, frame: int | None) -> Model:
    """Show a frame: the one in progress, or the stored one that is nearest."""
    if model.subject is None or frame is None:
        return model
    shown = frame if model.live.frame == frame or not model.frames else nearest(frame, model.frames)
    newest = model.frames[-NEAR_THE_END:]
    follow = model.selection.follow and (not model.is_searching or not newest or frame >= newest[0])
    if model.live.reannealed and shown != model.live.frame:
        model = replace(model, live=LiveSearch())
    if shown == model.selection.frame:
        return select(model, follow=follow)
    return select(model, frame=shown, follow=follow)


def nearest(frame: int, frames: Sequence[int]) -> int:
    """The stored frame nearest to `frame`."""
    return min(frames, key=lambda stored: abs(stored - frame))


def look_through(model: Model, camera: str | None) -> Model:
    """Look through a camera (None: no longer); unknown ones change nothing."""
    if model.subject is None or (camera is not None and camera not in model.subject.cameras):
        return model
    return select(model, look_through=camera)


def limb_clicked(model: Model, limb: str) -> Model:
    """Choose a limb, or let it go."""
    return select(model, limb=None if limb == model.selection.limb else limb)


def camera_clicked(model: Model, camera: str, twice: bool = False) -> Model:
    """Choose a camera, or let it go; clicked twice it is looked through, or no longer."""
    through = model.selection.look_through
    if twice:
        return select(look_through(model, None if camera == through else camera), camera=camera)
    if through is not None:
        return model
    return select(model, camera=None if camera == model.selection.camera else camera)


def change_options(model: Model, changes: Mapping[str, object]) -> Model:
    """Change what is shown, by the names of `ViewOptions`."""
    options = replace(model.options, **changes)
    return model if options == model.options else replace(model, options=options)


def tick_listed(model: Model, name: str, entry: str, ticked: bool) -> Model:
    """Put an entry into the option "limbs", "trail_markers" or "overlays", or take it out."""
    before = (
        getattr(model.options, name) if model.subject is None else model.subject.listed(name, model.options)
    )
    kept = tuple(one for one in before or () if one != entry)
    return change_options(model, {name: (*kept, entry) if ticked else kept})


def point_at(model: Model, particle: int | None) -> Model:
    """Note the particle of the shown layer that the pointer is on."""
    return model if particle == model.pointed else replace(model, pointed=particle)


# Playing stored frames.


def set_playback(
    model: Model, playing: bool | None = None, speed: float | None = None, loop: bool | None = None
) -> Model:
    """Play or stop, and how; None leaves it."""
    now = model.playback
    after = Playback(
        now.playing if playing is None else playing,
        now.speed if speed is None else speed,
        now.loop if loop is None else loop,
        now.debt if playing is None else 0.0,
    )
    if after.playing and model.layers.playing:
        model = stop_layers(model)
    return model if after == now else replace(model, playback=after)


def advance(model: Model, seconds: float) -> Model:
    if model.subject is None or not model.playback.playing:
        return model
    after, frame = played(model.playback, seconds * model.subject.fps, model.selection.frame, model.frames)
    model = replace(model, playback=after)
    return model if frame == model.selection.frame else show_frame(model, frame)


def played(
    playback: Playback, due: float, frame: int | None, frames: Sequence[int]
) -> tuple[Playback, int | None]:
    """The playback and the frame to show after `due` frames of real time. frames : the stored ones, ascending.

    At the end it starts over or stops; a frame between two stored ones takes the next one.
    """
    if not playback.playing or not frames:
        return playback, frame
    if frame is None:
        return playback, frames[0]
    due = playback.debt + due * playback.speed
    steps = int(due)
    if steps == 0:
        return replace(playback, debt=due), frame
    place = bisect.bisect_left(frames, frame) + steps
    if place >= len(frames) and not playback.loop:
        return replace(playback, playing=False, debt=0.0), frames[-1]
    return replace(playback, debt=due - steps), frames[place % len(frames)]


# Playing the layers of the shown frame.


def set_layer_playback(
    model: Model, playing: bool | None = None, rate: float | None = None, mode: str | None = None
) -> Model:
    """Play the shown frame's layers or stop, and how; None leaves it. Frames and layers are not played at once."""
    now = model.layers
    after = replace(
        now,
        playing=now.playing if playing is None else playing,
        rate=now.rate if rate is None else rate,
        mode=now.mode if mode is None else mode,
    )
    if after.playing and not now.playing:
        after = replace(after, phase=0.0, backwards=False)
        model = set_playback(model, playing=False)
    elif not after.playing:
        after = replace(after, phase=1.0, backwards=False)
    return model if after == now else replace(model, layers=after)


def stop_layers(model: Model) -> Model:
    """Stop playing layers: the shown one stays, its particles at their places."""
    return set_layer_playback(model, playing=False)


def scrub(model: Model, layer: int | None) -> Model:
    """Show one layer's cloud (None: all) by hand: playing stops, and particles travel from layer to layer."""
    before = model.selection.layer
    model = select(stop_layers(model), layer=layer)
    is_next = layer is not None and before is not None and layer == before + 1
    return replace(model, layers=replace(model.layers, phase=0.0)) if is_next else model


def advance_layers(model: Model, seconds: float, count: int) -> Model:
    """Advance the playback of layers, or the way to a layer that was chosen, by `seconds`. count : layers of the shown
    frame that are there so far.
    """
    if not model.layers.playing:
        phase = min(1.0, model.layers.phase + seconds * STEP_RATE)
        return (
            model
            if phase == model.layers.phase
            else replace(model, layers=replace(model.layers, phase=phase))
        )
    if count < 1:
        return model
    layers, layer = played_layers(model.layers, seconds, model.selection.layer, count)
    return select(replace(model, layers=layers), layer=layer)


def played_layers(
    layers: LayerPlayback, seconds: float, layer: int | None, count: int
) -> tuple[LayerPlayback, int]:
    """The playback and the layer to show after so many seconds. count : layers there are, from 0; one at least.

    No layer is skipped, however long nothing was drawn. A ping-pong shows the last and the first layer both ways.
    """
    if layer is None or layer >= count:
        return replace(layers, phase=0.0, backwards=False), 0
    passed = seconds * layers.rate
    if layers.backwards and layers.mode == PING_PONG:
        phase = layers.phase - passed
        if phase > 0.0:
            return replace(layers, phase=phase), layer
        late = min(-phase, MOST_LATE)
        if layer > 0:
            return replace(layers, phase=1.0 - late), layer - 1
        return replace(layers, phase=late, backwards=False), 0
    phase = layers.phase + passed
    if phase < 1.0:
        return replace(layers, phase=phase, backwards=False), layer
    late = min(phase - 1.0, MOST_LATE)
    if layer + 1 < count:
        return replace(layers, phase=late, backwards=False), layer + 1
    if layers.mode == PING_PONG and count > 1:
        return replace(layers, phase=1.0 - late, backwards=True), layer
    return replace(layers, phase=late, backwards=False), 0


# What the tracking process reports.


def hear(model: Model, event: Event, frames: tuple[int, ...] = ()) -> Model:
    """Apply an event of the tracking process. frames : stored now, if a frame was finished."""
    if isinstance(event, StateChanged):
        return _hear_state(model, event)
    if model.knobs is None or (event.session, event.run) != (model.selection.session, model.selection.run):
        return model
    if isinstance(event, SettingsApplied):
        settings = changed_settings(model.knobs.settings, event.values)
        since = event.frame, event.layer
        return replace(model, knobs=replace(model.knobs, settings=settings, since=since, drafts={}))
    if not isinstance(event, LayerFinished | FrameFinished):
        return model
    if event.reannealed and not model.options.trials:
        return model
    model = replace(model, live=searched_on(model.live, event))
    if isinstance(event, FrameFinished) and not event.reannealed:
        model = replace(model, frames=frames)
    if model.selection.follow and not event.reannealed and model.live.frame != model.selection.frame:
        model = select(model, frame=model.live.frame)
    return model


def _hear_state(model: Model, state: StateChanged) -> Model:
    before = model.is_searched and model.is_searching
    model = replace(model, search=state)
    if state.state is RunState.LOST and model.knobs is not None:
        model = replace(model, knobs=replace(model.knobs, requested={}))
    if model.is_searched and model.is_searching and not before:
        model = edit_pose(model, ended)  # show the search
    return model


def searched_on(live: LiveSearch, event: LayerFinished | FrameFinished) -> LiveSearch:
    """The search after another layer or its result.

    A layer of another frame, of the other kind, or with a known number starts again.
    """
    if isinstance(event, FrameFinished):
        same = (live.frame, live.reannealed) == (event.result.frame, event.reannealed)
        return LiveSearch(event.result.frame, event.reannealed, live.records if same else (), event.result)
    record = event.record
    goes_on = (
        live.result is None
        and (live.frame, live.reannealed) == (record.frame, event.reannealed)
        and bool(live.records)
        and live.records[-1].layer < record.layer
    )
    return LiveSearch(record.frame, event.reannealed, (*live.records, record) if goes_on else (record,))


# Knobs: requested here, taken or refused by the tracking process.


def request(model: Model, identifier: str, changes: Mapping[str, Value]) -> Model:
    assert model.knobs is not None
    waiting = dict([*model.knobs.requested.items(), (identifier, changes)][-REMEMBERED:])
    drafts = {name: value for name, value in model.knobs.drafts.items() if name not in changes}
    return replace(model, knobs=replace(model.knobs, requested=waiting, drafts=drafts))


def settle(model: Model, identifier: str, taken: bool) -> Model:
    """Apply the tracking process's answer: the values are in use, or the earlier ones are shown again."""
    if model.knobs is None or identifier not in model.knobs.requested:
        return model
    waiting = dict(model.knobs.requested)
    changes = waiting.pop(identifier)
    settings = model.knobs.settings
    in_use = changed_settings(settings, changes) if taken else settings
    model = replace(model, knobs=replace(model.knobs, requested=waiting, settings=in_use))
    return model if taken else refuse(model, changes)


def refuse(model: Model, changes: Mapping[str, Value]) -> Model:
    """Reject a change of knobs: they show the values in use, but incomplete text (such as a list of numbers) stays."""
    if model.knobs is None:
        return model
    texts = {knob.name for knob in all_knobs(model.knobs.settings) if knob.kind is str and not knob.choices}
    drafts = {name: value for name, value in changes.items() if name in texts}
    return replace(model, knobs=replace(model.knobs, drafts={**model.knobs.drafts, **drafts}))


# The pose that is edited.


def edit_pose(model: Model, change: Callable[[PoseEdit], PoseEdit]) -> Model:
    if model.edit is None:
        return model
    edit = change(model.edit)
    return select(replace(model, edit=edit), editing=edit.active)
