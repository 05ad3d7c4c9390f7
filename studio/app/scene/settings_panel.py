"""The knobs of a run as controls, made from their declarations.

A number with a range is a slider, words to choose from a dropdown, yes or no a check box, other text a text field. A
changed value carries a dot in its label and a button that puts the default back.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import viser

from studio.app.scene.controls import Control, Post, on_press, take_out
from studio.app.scene.model import Knobs, Model
from studio.foundations.knobs import Knob, Value, allowed, knobs_of
from studio.search.settings import RunSettings, all_knobs, values
from studio.search.trackers.catalogue import presets

FOREMOST = 6
NO_PRESET = "choose …"
FIRST_SPAN = 5
"""A slider over a very wide range would be too coarse: it first spans this multiple of the default, and grows when it
reaches its end."""

Request = Callable[[Model, Mapping[str, Value]], Model]
"""Requests knobs from the tracking process; unchanged ones are left out."""


class SettingsPanel:
    """search, weighting, masks : the tabs that carry the controls."""

    def __init__(
        self,
        gui: viser.GuiApi,
        search: viser.GuiTabHandle,
        weighting: viser.GuiTabHandle,
        masks: viser.GuiTabHandle,
        post: Post,
        request: Request,
    ) -> None:
        self._gui, self._post, self._request = gui, post, request
        self._search, self._weighting, self._masks = search, weighting, masks
        self._folders: list[viser.GuiFolderHandle] = []
        self._made_for: tuple[str, ...] = ()
        self._resets: list[tuple[viser.GuiButtonHandle, tuple[Knob, ...]]] = []
        self.inputs: dict[str, KnobInput] = {}
        self.preset: Control | None = None

    def show(self, knobs: Knobs) -> None:
        made_for = (knobs.settings.tracker_name, knobs.settings.weighting_name, *values(knobs.settings))
        if made_for != self._made_for:
            self._build(knobs.settings)
            self._made_for = made_for
        shown = knobs.shown
        for name, value in shown.items():
            self.inputs[name].show(value)
        self.since.content = since_in_words(knobs)
        if self.preset is not None:
            self.preset.show(NO_PRESET)
        for button, declared in self._resets:
            moved = sum(shown[knob.name] != knob.default for knob in declared)
            button.visible = moved > 1
            button.label = f"Reset {moved} to their defaults"

    def _build(self, settings: RunSettings) -> None:
        for folder in self._folders:
            take_out(folder)
        self._folders, self._resets, self.inputs = [], [], {}
        now = values(settings)
        with self._search, self._folder():
            self.since = self._gui.add_markdown("")
            self._add_presets(settings)
            tracker = knobs_of(settings.tracker)
            self._add(tracker[:FOREMOST], now)
            others = [
                ("More of the search", tracker[FOREMOST:]),
                ("Refinement", knobs_of(settings.refinement)),
                ("When lost", knobs_of(settings.recovery)),
                ("Recording", knobs_of(settings.recording)),
            ]
            for label, declared in others:
                if declared:
                    with self._gui.add_folder(label, expand_by_default=False):
                        self._add(declared, now)
            self._add_reset([*tracker[:FOREMOST], *(knob for _, declared in others for knob in declared)])
        for tab, group in ((self._weighting, settings.weighting), (self._masks, settings.evidence)):
            with tab, self._folder():
                declared = knobs_of(group)
                self._add(declared, now)
                self._add_reset(declared)

    def _folder(self) -> viser.GuiFolderHandle:
        self._folders.append(self._gui.add_folder(None))
        return self._folders[-1]

    def _add(self, declared: Sequence[Knob], now: Mapping[str, Value]) -> None:
        for knob in declared:
            self.inputs[knob.name] = KnobInput(self._gui, knob, now[knob.name], self._post, self._request)

    def _add_presets(self, settings: RunSettings) -> None:
        """Those made for the run's tracker and likelihood, whose other knobs a run keeps."""
        movable = {knob.name for knob in all_knobs(settings) if knob.takes_effect != "new run"}
        offered = {
            one.name: one
            for one in presets()
            if one.fits(settings.tracker_name, settings.weighting_name)
            and one.values.keys() <= values(settings).keys()
        }
        self.preset = None
        if offered:
            hint = " ".join(f"{one.name}: {one.help}" for one in offered.values())
            handle = self._gui.add_dropdown("preset", (NO_PRESET, *offered), hint=hint)
            wanted = {
                name: {knob: value for knob, value in one.values.items() if knob in movable}
                for name, one in offered.items()
            }
            self.preset = Control(
                handle, self._post, lambda model, name: self._request(model, wanted.get(name, {}))
            )

    def _add_reset(self, declared: Sequence[Knob]) -> None:
        changeable = tuple(knob for knob in declared if knob.takes_effect != "new run")
        button = self._gui.add_button("Reset to defaults", color="gray", visible=False)
        defaults = {knob.name: knob.default for knob in changeable}

        def reset(model: Model) -> Model:
            return self._request(model, defaults)

        on_press(button, self._post, reset)
        self._resets.append((button, changeable))


class KnobInput:
    """The control of one knob, and the button that puts its default back."""

    def __init__(self, gui: viser.GuiApi, knob: Knob, value: Value, post: Post, request: Request) -> None:
        self.knob = knob
        self.handle = _make(gui, knob, value)
        self._control = Control(
            self.handle, post, lambda model, moved: request(model, {knob.name: knob_value(knob, moved)})
        )
        # A group of one button is small and stands in line with its input.
        self.reset = gui.add_button_group(" ", (f"reset to {in_words(knob, knob.default)}",), visible=False)

        def put_back(model: Model, _pressed: str) -> Model:
            return request(model, {knob.name: knob.default})

        on_press(self.reset, post, put_back)

    def show(self, value: Value) -> None:
        knob, handle = self.knob, self.handle
        if isinstance(handle, viser.GuiSliderHandle) and knob.high is not None:
            number = float(value)
            if number >= handle.max < knob.high:
                handle.max = knob.kind(min(knob.high, 2 * max(number, handle.max)))
        self._control.show(value if knob.kind in (bool, str) else knob.kind(value))
        changed = value != knob.default
        handle.label = title(knob, changed)
        self.reset.visible = changed and not handle.disabled


def since_in_words(knobs: Knobs) -> str:
    """Since when the settings are in use, as text."""
    if knobs.since is None:
        return "_Settings from the start of the run._"
    return f"_In use since frame {knobs.since[0]}, layer {knobs.since[1] + 1}._"


def title(knob: Knob, changed: bool) -> str:
    """The control's label: a dot where the value was changed, the name, the unit."""
    unit = f" ({knob.unit})" if knob.unit else ""
    return f"{'• ' if changed else ''}{knob.label}{unit}"


def in_words(knob: Knob, value: Value) -> str:
    """A value in words: yes or no, numbers without noise, empty text as a dash."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return f"{text} {knob.unit}".strip() or "–"


def knob_value(knob: Knob, value: Value) -> Value:
    """A control's value as the knob's: noise of the slider's arithmetic removed, held at the range's lower end where
    the slider begins at a rounder number.
    """
    if knob.kind in (bool, str) or knob.low is None or knob.high is None:
        return value
    return knob.kind(max(round(float(value), 9), knob.low))


def slider_range(knob: Knob, value: Value) -> tuple[float, float, float]:
    """Least, most and step of a number's slider: steps fall on round numbers, the end may lie before the knob's."""
    low, high = float(knob.low or 0.0), float(knob.high or 0.0)
    step = float(knob.step or (high - low) / 100.0)
    start = math.floor(low / step + 1e-9) * step
    usual = FIRST_SPAN * max(abs(float(knob.default)), abs(float(value)), step)
    end = high if (high - low) / step <= 200 else min(high, max(start + 100 * step, usual))
    return round(start, 9), round(end, 9), step


WHILE_TRACKED = " of a run that is being tracked; else the frame that is shown is searched again at once"


def _make(gui: viser.GuiApi, knob: Knob, value: Value) -> viser.GuiInputHandle[Any]:
    default, is_movable = in_words(knob, knob.default), knob.takes_effect != "new run"
    when = f"{knob.takes_effect}{WHILE_TRACKED * is_movable}"
    hint = f"{knob.help} Default {default}; {allowed(knob)}. Takes effect: {when}."
    label = title(knob, value != knob.default)
    more: dict[str, Any] = {"hint": hint, "disabled": not is_movable}
    if knob.kind is bool:
        return gui.add_checkbox(label, bool(value), **more)
    if knob.choices:
        return gui.add_dropdown(label, knob.choices, initial_value=str(value), **more)
    if knob.kind is str:
        return gui.add_text(label, str(value), **more)
    if knob.low is None or knob.high is None:
        return gui.add_number(label, knob.kind(value), step=knob.step, **more)
    low, high, step = (knob.kind(number) for number in slider_range(knob, value))
    return gui.add_slider(label, low, high, step, knob.kind(value), **more)
