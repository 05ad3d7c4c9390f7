"""The settings in viser's panel, made from the declarations of the knobs in use.

A control only asks `change` for a value; what is in use comes back as a `SettingsApplied` event and is
shown by `show_applied`, which asks for nothing.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import viser

from studio.errors import StudioError
from studio.knobs import Knob, Value, knobs_of
from studio.scene.knob_input import KnobInput
from studio.settings import RunSettings, values
from studio.tracking.catalogue import presets
from studio.tracking.tracker import Preset
from studio.worker.events import SettingsApplied

_FOREMOST = 6
_NO_PRESET = "choose …"
_AS_BEGUN = "_Settings as the run began._"

Change = Callable[[dict[str, Value]], str]
Refused = Callable[[StudioError], None]


@dataclass(frozen=True, slots=True)
class SettingsTabs:
    """The containers of the four groups, in which the controls are put."""

    search: viser.GuiTabHandle
    weighting: viser.GuiTabHandle
    masks: viser.GuiTabHandle


class SettingsPanel:
    """change : asks for knobs (the identifier of the answer comes back); refused : tells the person."""

    def __init__(self, gui: viser.GuiApi, tabs: SettingsTabs, change: Change, refused: Refused) -> None:
        self._gui = gui
        self._tabs = tabs
        self._change = change
        self._refused = refused
        self._folders: list[viser.GuiFolderHandle] = []
        self._names: tuple[str, ...] = ()
        self._resets: list[tuple[viser.GuiButtonHandle, tuple[str, ...]]] = []
        self._in_use: viser.GuiMarkdownHandle | None = None
        self._presets: tuple[Preset, ...] = ()
        self.inputs: dict[str, KnobInput] = {}
        self.preset: viser.GuiDropdownHandle[str] | None = None

    def show_settings(self, settings: RunSettings) -> None:
        """Show a run's settings; the controls are made anew only when other knobs are needed."""
        now = values(settings)
        if tuple(now) != self._names or settings.tracker_name != getattr(self, "_tracker", None):
            self._build(settings)
        for name, value in now.items():
            self.inputs[name].show(value)
        if self._in_use is not None:
            self._in_use.content = _AS_BEGUN
        self._dress_resets()

    def show_applied(self, event: SettingsApplied) -> None:
        """Show what is in use since when."""
        for name, value in event.values.items():
            if name in self.inputs:
                self.inputs[name].show(value)
        if self._in_use is not None:
            self._in_use.content = in_use(event)
        self._dress_resets()

    def settle(self, identifier: str, taken: bool) -> None:
        """Take the answer to what was asked for under an identifier."""
        for entry in self.inputs.values():
            entry.settle(identifier, taken)
        self._dress_resets()

    def clear(self) -> None:
        """Take all controls out of the panel."""
        for folder in self._folders:
            folder.remove()
        self._folders, self._resets, self.inputs = [], [], {}
        self._names, self._in_use, self.preset = (), None, None

    def _build(self, settings: RunSettings) -> None:
        self.clear()
        now = values(settings)
        self._names, self._tracker = tuple(now), settings.tracker_name
        with self._tabs.search, self._folder():
            self._in_use = self._gui.add_markdown(_AS_BEGUN)
            self._add_presets()
            tracker = knobs_of(type(settings.tracker))
            self._add(tracker[:_FOREMOST], now)
            self._add_folded("More of the search", tracker[_FOREMOST:], now)
            others = ()
            for title, group in (
                ("Refinement", settings.refinement),
                ("When lost", settings.recovery),
                ("Recording", settings.recording),
            ):
                declared = knobs_of(type(group))
                self._add_folded(title, declared, now)
                others += declared
            self._add_reset((*tracker, *others))
        for tab, group in ((self._tabs.weighting, settings.weighting), (self._tabs.masks, settings.evidence)):
            with tab, self._folder():
                declared = knobs_of(type(group))
                self._add(declared, now)
                self._add_reset(declared)

    def _folder(self, label: str | None = None) -> viser.GuiFolderHandle:
        folder = self._gui.add_folder(label, expand_by_default=label is None)
        if label is None:
            self._folders.append(folder)
        return folder

    def _add(self, declared: Sequence[Knob], now: Mapping[str, Value]) -> None:
        for knob in declared:
            self.inputs[knob.name] = KnobInput(self._gui, knob, now[knob.name], self._ask, self._refused)

    def _add_folded(self, label: str, declared: Sequence[Knob], now: Mapping[str, Value]) -> None:
        if declared:
            with self._folder(label):
                self._add(declared, now)

    def _add_presets(self) -> None:
        self._presets = tuple(one for one in presets() if one.values.keys() <= set(self._names))
        if not self._presets:
            return
        self.preset = self._gui.add_dropdown(
            "preset",
            (_NO_PRESET, *(preset.name for preset in self._presets)),
            hint=" ".join(f"{preset.name}: {preset.help}" for preset in self._presets),
        )
        self.preset.on_update(self._preset_chosen)

    async def _preset_chosen(self, event: viser.GuiEvent) -> None:
        chosen = [preset for preset in self._presets if preset.name == event.target.value]
        if chosen:
            self.ask_all(chosen[0].values)
            event.target.value = _NO_PRESET

    def ask_all(self, wanted: Mapping[str, Value]) -> None:
        """Ask for several knobs at once; all are changed or, if one is refused, none."""
        changes = {name: value for name, value in wanted.items() if self.inputs[name].accepted != value}
        if not changes:
            return
        try:
            identifier = self._change(changes)
        except StudioError as refusal:
            self._refused(refusal)
            return
        for name, value in changes.items():
            self.inputs[name].await_answer(identifier, value)
        self._dress_resets()

    def _ask(self, name: str, value: Value) -> str:
        identifier = self._change({name: value})
        self._dress_resets(pending={name: value})
        return identifier

    def _add_reset(self, declared: Sequence[Knob]) -> None:
        names = tuple(knob.name for knob in declared if knob.takes_effect != "new run")
        button = self._gui.add_button("Reset to defaults", color="gray", visible=False)

        async def reset(_: viser.GuiEvent) -> None:
            self.ask_all({name: self.inputs[name].knob.default for name in names})

        button.on_click(reset)
        self._resets.append((button, names))

    def _dress_resets(self, pending: Mapping[str, Value] | None = None) -> None:
        pending = pending or {}
        for button, names in self._resets:
            moved = [
                name
                for name in names
                if pending.get(name, self.inputs[name].accepted) != self.inputs[name].knob.default
            ]
            button.visible = len(moved) > 1
            button.label = f"Reset {len(moved)} to their defaults"


def in_use(event: SettingsApplied) -> str:
    """Since when the settings are in use, in words."""
    return f"_In use since frame {event.frame}, layer {event.layer + 1}._"
