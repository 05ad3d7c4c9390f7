"""The run's controls: tracking on, pausing, stepping; playing what is stored; how far it is."""

from collections.abc import Callable
from html import escape
from typing import Protocol

import viser

from studio.errors import StudioError
from studio.runs.colour_tokens import ColourTokens
from studio.scene.playback import SPEEDS, Playback
from studio.scene.wishes import Wishes
from studio.tracking.tracker import LIMB_LOST, LOST, NO_EVIDENCE, RECOVERED
from studio.worker.events import StateChanged
from studio.worker.search_pace import in_words, offered

_TRACK = ("▶ track", "pause", "cancel")
_STEP = ("layer", "frame", "re-anneal")
_MOVE = ("|◀", "◀", "play", "▶", "▶|")
MARKS = {
    LOST: ("bad", "the tracker is off the body and searches for it"),
    LIMB_LOST: ("warn", "a limb is off, the silhouettes deny it"),
    NO_EVIDENCE: ("text-quiet", "nothing is to be seen, the pose is held"),
    RECOVERED: ("good", "the body was found again"),
}
_STATE_WORDS = {"reannealing": "annealing again", "lost": "worker lost", "compiling": "compiling, once"}


class Transport(Protocol):
    """What the playing controls move (the presenter)."""

    def show_frame(self, frame: int | None) -> None:
        """Show a stored frame."""
        ...

    def step(self, frames: int) -> None:
        """Show the stored frame so many places on."""
        ...

    def set_playback(
        self,
        *,
        playing: bool | None = None,
        speed: float | None = None,
        loop: bool | None = None,
        follow: bool | None = None,
    ) -> None:
        """Play or stop, change how; None leaves it."""
        ...

    def reanneal_shown(self) -> None:
        """Anneal the shown frame again."""
        ...

    def search(self, command: Callable[[], None]) -> None:
        """Give a command about the shown run. Raises StudioError while another is tracked."""
        ...


class RunPanel:
    """refused : tells the person about a command that was refused."""

    def __init__(
        self,
        gui: viser.GuiApi,
        folder: viser.GuiFolderHandle,
        wishes: Wishes,
        transport: Transport,
        refused: Callable[[StudioError], None],
    ) -> None:
        self._wishes = wishes
        self._transport = transport
        self._refused = refused
        self._span = (0, 1)
        self._frame = 0
        self._playing = False
        self._pace = 0.0
        self.status = gui.add_html(status_html(None), order=0.0)
        self.mark = gui.add_html("", visible=False, order=0.05)
        self.progress = gui.add_progress_bar(0.0, visible=False, order=0.1)
        with folder:
            self.track = gui.add_button_group(
                "track", _TRACK, hint="Track on, pause after this layer, end the run."
            )
            self.one = gui.add_button_group(
                "step", _STEP, hint="One layer, one frame, or this frame once more."
            )
            self.pace = gui.add_dropdown(
                "search at",
                tuple(choice.label for choice in offered()),
                hint="How slowly the search goes, to watch it layer by layer. Steps are not slowed; no result changes.",
            )
            self.move = gui.add_button_group("play", _MOVE, hint="First, back, play or stop, on, last.")
            self.timeline = gui.add_slider("frame", 0, 1, 1, 0, hint="The stored frame that is shown.")
            self.speed = gui.add_dropdown(
                "speed", tuple(f"{speed:g} ×" for speed in SPEEDS), initial_value="1 ×"
            )
            self.loop = gui.add_checkbox("loop", True, hint="Start over at the end.")
            self.follow = gui.add_checkbox(
                "follow the tracking", True, hint="Show each frame as it is tracked."
            )
        self.track.on_click(self._track_clicked)
        self.one.on_click(self._step_clicked)
        self.pace.on_update(self._pace_chosen)
        self.move.on_click(self._move_clicked)
        self.timeline.on_update(self._timeline_moved)
        self.speed.on_update(self._speed_chosen)
        self.loop.on_update(self._loop_ticked)
        self.follow.on_update(self._follow_ticked)

    def show_state(self, state: StateChanged | None) -> None:
        """Show how the run stands, with what is left of it."""
        self.status.content = status_html(state)
        total = max(1, state.last - state.first) if state else 1
        self.progress.visible = bool(state and state.state in ("tracking", "paused", "compiling"))
        self.progress.animated = bool(state and state.state in ("tracking", "compiling"))
        self.progress.value = min(100.0, 100.0 * state.done / total) if state else 0.0

    def show_mark(self, tracking: str, tokens: ColourTokens, found: str = "") -> None:
        """Say how the shown frame went, where it did not simply go on. found : of a start pose shown instead."""
        content = mark_html(tracking, tokens) if tracking in MARKS else ""
        if found:
            content = words_html("start pose", found, tokens["good"])
        if self.mark.content != content:
            self.mark.content = content
        if self.mark.visible != bool(content):
            self.mark.visible = bool(content)

    def show_pace(self, seconds_a_layer: float) -> None:
        """Show how slowly the search goes, without asking for it again."""
        self._pace = seconds_a_layer
        options = tuple(choice.label for choice in offered(seconds_a_layer))
        # The value goes first: options that do not hold it would put the first one in its place, as if chosen.
        if self.pace.value != in_words(seconds_a_layer):
            self.pace.value = in_words(seconds_a_layer)
        if tuple(self.pace.options) != options:
            self.pace.options = options

    def show_stored(self, session: str, run: str, done: int, total: int) -> None:
        """Show how a run stands that the tracking process does not have open (run "" : the session alone)."""
        first = f"{session} / {run}" if run else session
        self.status.content = _two_lines(
            first, f"stored · {done} of {total} frames" if run else f"{total} frames, no run shown"
        )
        self.progress.visible = False

    def show_frame(self, frame: int | None, span: tuple[int, int]) -> None:
        """Show which frame is shown, of which (half open)."""
        first, last = span[0], max(span[0] + 1, span[1] - 1)
        if (first, last) != self._span:
            self._span = (first, last)
            self.timeline.min, self.timeline.max = first, last
        if frame is not None:
            self._frame = frame
            if self.timeline.value != frame:
                self.timeline.value = frame

    def show_playback(self, pace: Playback, follow: bool) -> None:
        """Show how stored frames are played, without asking for it again."""
        self._playing = pace.playing
        options = (*_MOVE[:2], "stop" if pace.playing else "play", *_MOVE[3:])
        if tuple(self.move.options) != options:
            self.move.options = options
        if self.speed.value != f"{pace.speed:g} ×":
            self.speed.value = f"{pace.speed:g} ×"
        if self.loop.value != pace.loop:
            self.loop.value = pace.loop
        if self.follow.value != follow:
            self.follow.value = follow

    async def _track_clicked(self, event: viser.GuiEvent) -> None:
        commands = {_TRACK[0]: self._wishes.start, _TRACK[1]: self._wishes.pause}
        self._obey(lambda: self._transport.search(commands.get(event.target.value, self._wishes.cancel)))

    async def _step_clicked(self, event: viser.GuiEvent) -> None:
        steps = {_STEP[0]: self._wishes.step_layer, _STEP[1]: self._wishes.step_frame}
        step = steps.get(event.target.value)
        self._obey((lambda: self._transport.search(step)) if step else self._transport.reanneal_shown)

    async def _pace_chosen(self, event: viser.GuiEvent) -> None:
        chosen = {choice.label: choice.seconds_a_layer for choice in offered(self._pace)}
        seconds = chosen.get(event.target.value, self._pace)
        if seconds == self._pace:
            return
        try:
            self._wishes.set_pace(seconds)
        except StudioError as refusal:
            self._refused(refusal)
            self.show_pace(self._pace)

    async def _move_clicked(self, event: viser.GuiEvent) -> None:
        word = event.target.value
        chosen = _MOVE.index(word) if word in _MOVE else 2
        if chosen == 2:
            self._transport.set_playback(playing=not self._playing)
        elif chosen in (1, 3):
            self._transport.step(chosen - 2)
        else:
            self._transport.show_frame(self._span[0] if chosen == 0 else self._span[1])

    async def _timeline_moved(self, event: viser.GuiEvent) -> None:
        if event.target.value != self._frame:
            self._frame = int(event.target.value)
            self._transport.show_frame(self._frame)

    async def _speed_chosen(self, event: viser.GuiEvent) -> None:
        self._transport.set_playback(speed=float(event.target.value.removesuffix(" ×")))

    async def _loop_ticked(self, event: viser.GuiEvent) -> None:
        self._transport.set_playback(loop=bool(event.target.value))

    async def _follow_ticked(self, event: viser.GuiEvent) -> None:
        self._transport.set_playback(follow=bool(event.target.value))

    def _obey(self, action: Callable[[], None]) -> None:
        try:
            action()
        except StudioError as refusal:
            self._refused(refusal)


def status_html(state: StateChanged | None) -> str:
    """Which run, how it stands, how fast, how long still: two quiet lines."""
    if state is None or not state.run:
        return _two_lines("No run is open", "Open one in the list on the left.")
    words = _STATE_WORDS.get(state.state, state.state)
    parts = [f"frame {state.frame}", f"{state.done} of {state.last - state.first} done"]
    if state.live is not None:
        return _two_lines(
            f"{state.session} / {state.run} — {words}",
            " · ".join(part for part in (state.message, state.hint) if part) or state.live.in_words,
        )
    if state.state == "tracking" and state.frames_per_second == state.frames_per_second:
        parts.append(f"{state.frames_per_second:.3g} fps")
    if state.state == "tracking" and state.seconds_left == state.seconds_left:
        parts.append(f"{clock(state.seconds_left)} left")
    if state.message:
        parts = [state.message, state.hint]
    return _two_lines(f"{state.session} / {state.run} — {words}", " · ".join(part for part in parts if part))


def mark_html(tracking: str, tokens: ColourTokens) -> str:
    """How a frame went, in the colour of its mark on the timeline."""
    token, words = MARKS[tracking]
    return words_html(tracking, words, tokens[token])


def words_html(title: str, words: str, rgb: tuple[int, int, int]) -> str:
    """A dot in a colour, a title and words."""
    colour = "#{:02x}{:02x}{:02x}".format(*rgb)
    return (
        '<div style="padding:0 10px 4px;font-size:12px;display:flex;gap:6px;align-items:baseline">'
        f'<span style="flex:none;width:9px;height:9px;border-radius:50%;background:{colour}"></span>'
        f"<span><b>{escape(title)}</b>: {escape(words)}</span></div>"
    )


def clock(seconds: float) -> str:
    """Seconds as minutes:seconds, or hours:minutes:seconds."""
    whole = max(0, round(seconds))
    hours, minutes, rest = whole // 3600, whole // 60 % 60, whole % 60
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def _two_lines(first: str, second: str) -> str:
    return (
        '<div style="padding:2px 10px 4px;font-variant-numeric:tabular-nums">'
        f'<div style="font-size:13px;font-weight:600">{escape(first)}</div>'
        f'<div style="font-size:12px;opacity:.72;min-height:1.3em">{escape(second)}</div></div>'
    )
