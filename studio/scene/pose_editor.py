"""The pose's tab: what is being edited, buttons for what is done to it whole, and sliders for every angle, in degrees
and mm.
"""

import math
from typing import Protocol

import numpy as np
import viser
from numpy.typing import NDArray

from studio.body.model import BodyModel, Parameter
from studio.scene.edited_pose import EditedPose

Array = NDArray[np.float64]

_REACH_MM = 3000.0
_FREE_ANGLE_DEG = 180.0
_STEP_DEG, _STEP_MM = 0.5, 5.0
UNDO, RESET = "undo", "reset"
MIRROR, ROUND = "mirror left / right", "turn round"
NO_GRIP: str = "none"


class PoseWishes(Protocol):
    """What the tab asks for; called in viser's thread, each returns at once."""

    def ask_editing(self, editing: bool) -> None:
        """Begin or end editing."""
        ...

    def ask_value(self, index: int, value: float) -> None:
        """Give an entry of the pose (radians or mm) another value."""
        ...

    def ask_change(self, what: str) -> None:
        """Do something to the whole pose: UNDO, RESET, MIRROR, ROUND."""
        ...

    def ask_grip(self, name: str) -> None:
        """Take hold of a limb's end; "" lets go."""
        ...

    def ask_refinement(self) -> None:
        """Search around the pose, or stop searching."""
        ...

    def ask_saving(self) -> None:
        """Make it the session's start pose."""
        ...


class PoseEditor:
    """The tab's controls. They show what they are told to and ask `wishes` for what a person does with them."""

    def __init__(self, gui: viser.GuiApi, tab: viser.GuiTabHandle, wishes: PoseWishes) -> None:
        self._gui, self._tab, self._wishes = gui, tab, wishes
        self._body: BodyModel | None = None
        self._folders: list[viser.GuiFolderHandle] = []
        self.sliders: list[viser.GuiSliderHandle[float]] = []
        with tab:
            self.editing = gui.add_checkbox(
                "edit the pose",
                False,
                hint="Show it in the scene and on the pictures; drag the balls on its limbs.",
            )
            self.about = gui.add_markdown("", visible=False)
            self.grip = gui.add_dropdown(
                "drag",
                (NO_GRIP,),
                hint="The limb's end that carries the gizmo; or click a ball in the scene.",
            )
            self.back = gui.add_button_group("step", (UNDO, RESET), hint="One change back, or all of them.")
            self.whole = gui.add_button_group(
                "whole body",
                (MIRROR, ROUND),
                hint="Left and right exchanged where it stands, or facing the other way as well.",
            )
            self.refine = gui.add_button(
                "Refine from here", hint="A short search around the pose in this frame's pictures."
            )
            self.progress = gui.add_progress_bar(0.0, visible=False)
            self.save = gui.add_button("Save as the session's start pose", disabled=True)
        self.editing.on_update(self._ticked)
        self.grip.on_update(self._grip_chosen)
        self.back.on_click(self._change_clicked)
        self.whole.on_click(self._change_clicked)
        self.refine.on_click(self._refine_clicked)
        self.save.on_click(self._save_clicked)

    def show_body(self, body: BodyModel, pose: Array, grips: tuple[str, ...], *, has_sides: bool) -> None:
        """Offer the controls of a body, standing at a pose (D,) in radians and mm."""
        self._body = body
        for folder in self._folders:
            folder.remove()
        self._folders, self.sliders = [], []
        groups: dict[str, list[int]] = {}
        for index, parameter in enumerate(body.parameters):
            groups.setdefault(parameter.limb, []).append(index)
        with self._tab:
            for limb, indices in groups.items():
                folder = self._gui.add_folder(limb.replace("_", " "), expand_by_default=False)
                self._folders.append(folder)
                with folder:
                    for index in indices:
                        self.sliders.append(self._slider(body.parameters[index], index, float(pose[index])))
        self._places = [index for indices in groups.values() for index in indices]
        self.grip.options = (NO_GRIP, *grips)
        self.whole.visible = has_sides
        self.dress(EditedPose(pose), editing=False)

    def show(self, edited: EditedPose, *, editing: bool, about: str = "", grip: str = "") -> None:
        """Put the controls at a pose. about : what is being edited, in words."""
        if self._body is None:
            return
        for slider, place in zip(self.sliders, self._places, strict=True):
            shown = shown_value(self._body.parameters[place], float(edited.pose[place]))
            shown = min(max(shown, slider.min), slider.max)
            if abs(slider.value - shown) > 1e-9:
                slider.value = shown
        if self.grip.value != (grip or NO_GRIP):
            self.grip.value = grip or NO_GRIP
        if self.about.content != about:
            self.about.content = about
        self.dress(edited, editing=editing)

    def dress(self, edited: EditedPose, *, editing: bool) -> None:
        """Offer what can be done with the pose as it is."""
        if self.editing.value != editing:
            self.editing.value = editing
        self.about.visible = editing and bool(self.about.content)
        self.grip.visible = self.back.visible = self.refine.visible = editing
        self.save.disabled = not edited.is_moved

    def show_refining(self, share: float | None) -> None:
        """Show how far the search around the pose is, 0 to 1; None: none is under way."""
        self.progress.visible = share is not None
        self.progress.value = 100.0 * (share or 0.0)
        label = "Refine from here" if share is None else "Stop refining"
        if self.refine.label != label:
            self.refine.label = label

    def _slider(self, parameter: Parameter, index: int, value: float) -> viser.GuiSliderHandle[float]:
        shown = shown_value(parameter, value)
        low, high = slider_limits(parameter, shown)
        unit, step = ("°", _STEP_DEG) if parameter.kind == "angle" else ("mm", _STEP_MM)
        slider = self._gui.add_slider(
            f"{parameter.label} ({unit})",
            low,
            high,
            step,
            shown,
            hint=f"{parameter.name}: {low:g} to {high:g} {unit}.",
        )

        async def updated(event: viser.GuiEvent) -> None:
            # Without a viewer it was this scene that moved it.
            if event.client_id is not None:
                self._wishes.ask_value(index, stored_value(parameter, float(event.target.value)))

        slider.on_update(updated)
        return slider

    async def _ticked(self, event: viser.GuiEvent) -> None:
        if event.client_id is not None:
            self._wishes.ask_editing(bool(event.target.value))

    async def _grip_chosen(self, event: viser.GuiEvent) -> None:
        if event.client_id is not None:
            self._wishes.ask_grip("" if event.target.value == NO_GRIP else event.target.value)

    async def _change_clicked(self, event: viser.GuiEvent) -> None:
        self._wishes.ask_change(event.target.value)

    async def _refine_clicked(self, _: viser.GuiEvent) -> None:
        self._wishes.ask_refinement()

    async def _save_clicked(self, _: viser.GuiEvent) -> None:
        self._wishes.ask_saving()


def shown_value(parameter: Parameter, value: float) -> float:
    """A pose's entry as it is shown: degrees or mm, to a tenth."""
    return round(math.degrees(value) if parameter.kind == "angle" else value, 1)


def stored_value(parameter: Parameter, shown: float) -> float:
    """What is shown as a pose's entry: radians or mm."""
    return math.radians(shown) if parameter.kind == "angle" else shown


def slider_limits(parameter: Parameter, shown: float) -> tuple[float, float]:
    """The slider's ends in degrees or mm: the body's limits, or a usual reach where there are none; a value
    outside (a start pose need not keep limits) widens them.
    """
    reach = _FREE_ANGLE_DEG if parameter.kind == "angle" else _REACH_MM
    low = shown_value(parameter, parameter.lower) if math.isfinite(parameter.lower) else -reach
    high = shown_value(parameter, parameter.upper) if math.isfinite(parameter.upper) else reach
    return min(low, math.floor(shown)), max(high, math.ceil(shown))
