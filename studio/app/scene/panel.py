"""viser's panel: the shown run and its state, and below them the tabs. The page has the transport controls."""

from html import escape

import numpy as np
import viser

from studio.app.scene.controls import Change, Post
from studio.app.scene.model import Model
from studio.app.scene.opened_run import Moment
from studio.app.scene.pose_panel import PosePanel
from studio.app.scene.settings_panel import Request, SettingsPanel
from studio.app.scene.show_panel import ShowPanel, css
from studio.operations.jobs.events import RunState, StateChanged
from studio.runs.drawing.colour_tokens import ColourTokens
from studio.search.trackers.tracker import LIMB_LOST, LOST, NO_EVIDENCE, RECOVERED

PANEL_WIDTH = 310
MARKS = {
    LOST: ("bad", "the tracker is off the body and searches for it"),
    LIMB_LOST: ("warn", "a limb is off, contradicted by the silhouettes"),
    NO_EVIDENCE: ("text-quiet", "no evidence, the pose is held"),
    RECOVERED: ("good", "the body was found again"),
}
STATE_WORDS = {
    RunState.REANNEALING: "annealing again",
    RunState.LOST: "worker lost",
    RunState.COMPILING: "compiling, once",
}


class Panel:
    """All controls. request, refine, save : changes that need more than the model, see the parts."""

    def __init__(
        self, server: viser.ViserServer, post: Post, request: Request, refine: Change, save: Change
    ) -> None:
        gui = server.gui
        gui.main_panel.dock_right()
        gui.main_panel.set_width(PANEL_WIDTH)
        self.status = gui.add_html("")
        self.mark = gui.add_html("", visible=False)
        self.tabs = tabs = gui.add_tab_group()
        search, show, weighting, masks, pose = (
            tabs.add_tab(name) for name in ("Search", "Show", "Likelihood", "Masks", "Pose")
        )
        self.settings = SettingsPanel(gui, search, weighting, masks, post, request)
        self.options = ShowPanel(gui, show, post)
        self.pose = PosePanel(gui, pose, post, refine, save)

    def show(self, model: Model, moment: Moment | None, tokens: ColourTokens) -> None:
        self.status.content = status_html(model)
        self.mark.content = mark_html(model, moment, tokens)
        self.mark.visible = bool(self.mark.content)
        if model.knobs is not None:
            self.settings.show(model.knobs)
        self.options.show(model, moment, tokens)
        self.pose.show(model)

    def hide(self) -> None:
        """Show nothing, for who may only look: the page says what stood here, and the scene has the room."""
        for part in (self.status, self.mark, self.tabs):
            if part.visible:
                part.visible = False


def dress(server: viser.ViserServer, tokens: ColourTokens) -> None:
    """Give viser the studio's theme: no logo, no sharing, our accent, our background, light or dark."""
    server.gui.configure_theme(
        dark_mode=tokens.name == "dark",
        show_logo=False,
        show_share_button=False,
        brand_color=tokens["accent"],
        control_width="medium",
    )
    server.scene.world_axes.visible = False
    background = np.full((2, 2, 3), tokens["scene-background"], dtype=np.uint8)
    server.scene.set_background_image(background, format="png")


def notify(server: viser.ViserServer, title: str, body: str, *, bad: bool = False) -> None:
    """Show every viewer a notification that disappears after a while."""
    for client in server.get_clients().values():
        client.add_notification(
            title, body, auto_close_seconds=8.0 if bad else 4.0, color="red" if bad else "green"
        )


def status_html(model: Model) -> str:
    """The shown run and its state: two lines."""
    selection, state, subject = model.selection, model.search, model.subject
    if model.trial is not None:
        return _two_lines(model.trial.body.title, "As it is being made.")
    if subject is None or model.is_searched or state.state is RunState.LOST:
        return search_html(state)
    first, last = subject.span
    if not selection.run:
        return _two_lines(selection.session, f"{last - first} frames, no run shown")
    name = f"{selection.session} / {selection.run}"
    return _two_lines(name, f"stored · {len(model.frames)} of {last - first} frames")


def search_html(state: StateChanged) -> str:
    """The state, rate and time left of the run that the tracking process has open."""
    if not state.run:
        return _two_lines("No run is open", "Open one in the list on the left.")
    name = f"{state.session} / {state.run} — {STATE_WORDS.get(state.state, state.state)}"
    messages = [part for part in (state.message, state.hint) if part]
    if state.live is not None:
        return _two_lines(name, " · ".join(messages) or state.live.in_words)
    parts = [f"{state.done} of {state.last - state.first} done"]
    if state.frame < state.last:
        parts.insert(0, f"frame {state.frame}")
    if state.state is RunState.TRACKING and state.frames_per_second == state.frames_per_second:
        parts.append(f"{state.frames_per_second:.3g} fps")
    if state.state is RunState.TRACKING and state.seconds_left == state.seconds_left:
        parts.append(f"{clock(state.seconds_left)} left")
    return _two_lines(name, " · ".join(messages if state.message else parts))


def mark_html(model: Model, moment: Moment | None, tokens: ColourTokens) -> str:
    """The tracking state of the shown frame, unless it was simply tracked, in the colour of its mark on the timeline;
    for a found start pose its confidence.
    """
    if model.edit is not None and model.edit.confidence:
        title, words, colour = "start pose", model.edit.confidence, tokens["good"]
    elif moment is not None and moment.tracking in MARKS:
        token, words = MARKS[moment.tracking]
        title, colour = moment.tracking, tokens[token]
    else:
        return ""
    return (
        '<div style="padding:0 10px 4px;font-size:12px;display:flex;gap:6px;align-items:baseline">'
        f'<span style="flex:none;width:9px;height:9px;border-radius:50%;background:{css(colour)}"></span>'
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
