"""One setting as a control of the panel, made from its declaration.

A number with a range is a slider, words to choose from a dropdown, yes or no a check box, other text a text
field. A changed value carries a dot in its label and a button that puts the default back.
"""

import math
import threading
from collections.abc import Callable

import viser

from studio.errors import StudioError
from studio.knobs import Knob, Value, allowed, checked

Handle = viser.GuiInputHandle
# A slider over a range far wider than what is usual moves in leaps: it first spans this many times the
# default,
# and grows when it is drawn to its end.
_FIRST_SPAN = 5


class KnobInput:
    """The control of one knob.

    change : asks for a value and returns the identifier under which the answer will come; raises
    StudioError if it cannot be asked for. refused : is told about a refusal. `accepted` is what the control
    shows, `in_use` what was last heard to be in use; they differ only while an answer is awaited.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        knob: Knob,
        value: Value,
        change: Callable[[str, Value], str],
        refused: Callable[[StudioError], None],
    ) -> None:
        self.knob = knob
        self.accepted: Value = value
        self.in_use: Value = value
        self._change = change
        self._refused = refused
        self._awaited: dict[str, Value] = {}
        # What is shown and what was accepted change together: viser reports every change later, from its own thread.
        self._together = threading.RLock()
        self.handle = _make(gui, knob, value)
        self.handle.on_update(self._updated)
        # A group of one button: as slight as what it resets, and in line with it.
        self.reset = gui.add_button_group(" ", (f"reset to {words(knob, knob.default)}",), visible=False)
        self.reset.on_click(self._reset)
        self._dress()

    def show(self, value: Value) -> None:
        """Show a value that is in use, without asking for it; while an answer is awaited the wish stays."""
        self.in_use = value
        if not self._awaited:
            self._put(value)

    def ask(self, value: Value) -> None:
        """Check a value and ask for it; what cannot be asked for is put back at once."""
        try:
            wanted = checked(self.knob, value)
            if wanted != self.accepted:
                self.await_answer(self._change(self.knob.name, wanted), wanted)
        except StudioError as refusal:
            self._refused(refusal)
            self._put_back()

    def await_answer(self, identifier: str, wanted: Value) -> None:
        """Show a value that was asked for, until its answer comes."""
        self._awaited[identifier] = wanted
        self._put(wanted)

    def settle(self, identifier: str, taken: bool) -> None:
        """Take an answer: the value is in use, or the one in use before is shown again."""
        if identifier not in self._awaited:
            return
        wanted = self._awaited.pop(identifier)
        if taken:
            self.in_use = wanted
        elif not self._awaited:
            self._put_back()

    @property
    def changed(self) -> bool:
        """Whether the value shown is not the default."""
        return self.accepted != self.knob.default

    def remove(self) -> None:
        """Take the control out of the panel."""
        self.handle.remove()
        self.reset.remove()

    async def _updated(self, event: viser.GuiEvent) -> None:
        # Assigning the handle's value from Python arrives here as well: what is shown already is no wish.
        with self._together:
            value = knob_value(self.knob, event.target.value)
            wished = value != self.accepted
        if wished:
            self.ask(value)

    async def _reset(self, _: viser.GuiEvent) -> None:
        self.ask(self.knob.default)

    def _put(self, value: Value) -> None:
        with self._together:
            self.accepted = value
            shown = slider_value(self.knob, value)
            self._widen(shown)
            if self.handle.value != shown:
                self.handle.value = shown
        self._dress()

    def _put_back(self) -> None:
        # Half-written text (a list of numbers, say) stays, so that it can be finished.
        if self.knob.kind is not str or self.knob.choices:
            self.handle.value = slider_value(self.knob, self.accepted)
            self._put(self.in_use)

    def _widen(self, value: Value) -> None:
        handle, high = self.handle, self.knob.high
        if not isinstance(handle, viser.GuiSliderHandle) or high is None:
            return
        number = float(value)
        if number >= handle.max < high:
            handle.max = self.knob.kind(min(high, 2 * max(number, handle.max)))

    def _dress(self) -> None:
        self.handle.label = title(self.knob, self.changed)
        self.reset.visible = self.changed and not self.handle.disabled


def title(knob: Knob, changed: bool) -> str:
    """The control's label: a dot where the value was changed, the name, the unit."""
    unit = f" ({knob.unit})" if knob.unit else ""
    return f"{'• ' if changed else ''}{knob.label}{unit}"


def hint(knob: Knob) -> str:
    """The tooltip: help, default, what is allowed, when it takes effect."""
    default = words(knob, knob.default)
    return f"{knob.help} Default {default}; {allowed(knob)}. Takes effect: {knob.takes_effect}."


def words(knob: Knob, value: Value) -> str:
    """A value in words: yes or no, numbers without noise, empty text as a dash."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return f"{text} {knob.unit}".strip() or "–"


def slider_value(knob: Knob, value: Value) -> Value:
    """A knob's value as its control holds it (sliders of whole numbers hold whole numbers)."""
    return value if knob.kind in (bool, str) else knob.kind(value)


def knob_value(knob: Knob, value: Value) -> Value:
    """A control's value as the knob's: noise of the slider's arithmetic removed, held at the range's lower
    end where the slider begins at a rounder number.
    """
    if knob.kind in (bool, str) or knob.low is None or knob.high is None:
        return value
    number = round(float(value), 9)
    return knob.kind(max(number, knob.low))


def slider_range(knob: Knob, value: Value) -> tuple[float, float, float]:
    """Least, most and step of a number's slider: steps fall on round numbers, the end may lie before the
    knob's.
    """
    low, high = float(knob.low or 0.0), float(knob.high or 0.0)
    step = float(knob.step or (high - low) / 100.0)
    start = math.floor(low / step + 1e-9) * step
    usual = _FIRST_SPAN * max(abs(float(knob.default)), abs(float(value)), step)
    end = high if (high - low) / step <= 200 else min(high, max(start + 100 * step, usual))
    return round(start, 9), round(end, 9), step


def _make(gui: viser.GuiApi, knob: Knob, value: Value) -> Handle:
    label, tip = title(knob, value != knob.default), hint(knob)
    fixed = knob.takes_effect == "new run"
    if knob.kind is bool:
        return gui.add_checkbox(label, bool(value), hint=tip, disabled=fixed)
    if knob.choices:
        return gui.add_dropdown(label, knob.choices, initial_value=str(value), hint=tip, disabled=fixed)
    if knob.kind is str:
        return gui.add_text(label, str(value), hint=tip, disabled=fixed)
    if knob.low is None or knob.high is None:
        return gui.add_number(label, knob.kind(value), step=knob.step, hint=tip, disabled=fixed)
    low, high, step = (knob.kind(number) for number in slider_range(knob, value))
    return gui.add_slider(label, low, high, step, knob.kind(value), hint=tip, disabled=fixed)
