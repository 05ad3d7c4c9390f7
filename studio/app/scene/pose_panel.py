"""The Pose tab: buttons for the whole pose, and a slider for every parameter, in degrees and mm."""

import math

import viser

from studio.app.scene.controls import Change, Control, Post, on_press, take_out
from studio.app.scene.model import Model, Subject, edit_pose
from studio.app.scene.pose_edit import (
    MIRROR,
    RESET,
    ROUND,
    UNDO,
    PoseEdit,
    begun,
    changed_whole,
    ended,
    entry_moved,
)
from studio.app.scene.pose_handles import take_hold
from studio.body.model import BodyModel, Parameter

NO_GRIP = "none"
_REACH_MM, _STEP_MM = 3000.0, 5.0
_FREE_ANGLE_DEG, _STEP_DEG = 180.0, 0.5


class PosePanel:
    """refine : starts the search around the pose, or stops it. save : makes it the session's start pose."""

    def __init__(
        self, gui: viser.GuiApi, tab: viser.GuiTabHandle, post: Post, refine: Change, save: Change
    ) -> None:
        self._gui, self._tab, self._post = gui, tab, post
        self._body: BodyModel | None = None
        self._folders: list[viser.GuiFolderHandle] = []
        self.sliders: dict[int, Control] = {}
        with tab:
            hint = "Show it in the scene and on the pictures; drag the balls on its limbs."
            self.editing = Control(gui.add_checkbox("edit the pose", False, hint=hint), post, edit_or_end)
            self.about = gui.add_markdown("", visible=False)
            hint = "The limb's end that carries the gizmo; or click a ball in the scene."
            grips = gui.add_dropdown("drag", (NO_GRIP,), hint=hint)
            self.grip = Control(
                grips, post, lambda model, name: take_hold(model, "" if name == NO_GRIP else name)
            )
            self.back = gui.add_button_group("step", (UNDO, RESET), hint="Undo one change, or all of them.")
            hint = "Exchange left and right in place, or turn the body to face the other way."
            self.whole = gui.add_button_group("whole body", (MIRROR, ROUND), hint=hint)
            hint = "A short search around the pose in this frame's pictures."
            self.refine = gui.add_button("Refine from here", hint=hint)
            self.progress = gui.add_progress_bar(0.0, visible=False)
            self.save = gui.add_button("Save as the session's start pose", disabled=True)
        for group in (self.back, self.whole):
            on_press(group, post, change_pose)
        on_press(self.refine, post, refine)
        on_press(self.save, post, save)

    def show(self, model: Model) -> None:
        """Show the pose and enable the possible actions."""
        edit, subject = model.edit, model.subject
        if edit is None or subject is None:
            return
        if subject.body is not self._body:
            self._offer(subject, edit)
        for index, control in self.sliders.items():
            value = shown_value(subject.body.parameters[index], float(edit.pose[index]))
            control.show(min(max(value, control.handle.min), control.handle.max))
        self.editing.show(edit.active)
        self.grip.show(edit.grip or NO_GRIP)
        self.about.content = _about(model, edit)
        for handle in (self.about, self.grip.handle, self.back, self.refine):
            handle.visible = edit.active
        self.save.disabled = not edit.is_moved
        self.progress.visible = edit.refining is not None
        self.progress.value = 100.0 * (edit.refining or 0.0)
        self.refine.label = "Refine from here" if edit.refining is None else "Stop refining"

    def _offer(self, subject: Subject, edit: PoseEdit) -> None:
        """Make the controls of another body."""
        for folder in self._folders:
            take_out(folder)
        self._body, self._folders, self.sliders = subject.body, [], {}
        groups: dict[str, list[int]] = {}
        for index, parameter in enumerate(subject.body.parameters):
            groups.setdefault(parameter.limb, []).append(index)
        for limb, indices in groups.items():
            with self._tab:
                self._folders.append(self._gui.add_folder(limb.replace("_", " "), expand_by_default=False))
            with self._folders[-1]:
                for index in indices:
                    parameter = subject.body.parameters[index]
                    handle = _slider(self._gui, parameter, float(edit.pose[index]))
                    self.sliders[index] = Control(handle, self._post, _entry_change(index, parameter))
        self.grip.handle.options = (NO_GRIP, *(grip.name for grip in subject.dragger.grips))
        self.whole.visible = subject.mirror is not None


def edit_or_end(model: Model, editing: bool) -> Model:
    """Edit the start pose, or stop editing."""
    return edit_pose(model, begun if editing else ended)


def change_pose(model: Model, change: str) -> Model:
    """UNDO, RESET, MIRROR or ROUND."""
    mirror = model.subject.mirror if model.subject is not None else None
    return edit_pose(model, lambda edit: changed_whole(edit, change, mirror))


def shown_value(parameter: Parameter, value: float) -> float:
    """A pose's entry as it is shown: degrees or mm, to a tenth."""
    return round(math.degrees(value) if parameter.kind == "angle" else value, 1)


def stored_value(parameter: Parameter, shown: float) -> float:
    """What is shown as a pose's entry: radians or mm."""
    return math.radians(shown) if parameter.kind == "angle" else shown


def slider_limits(parameter: Parameter, shown: float) -> tuple[float, float]:
    """The slider's ends in degrees or mm: the body's limits, or a default range without limits; a value outside
    (a start pose need not keep limits) widens them.
    """
    reach = _FREE_ANGLE_DEG if parameter.kind == "angle" else _REACH_MM
    low = shown_value(parameter, parameter.lower) if math.isfinite(parameter.lower) else -reach
    high = shown_value(parameter, parameter.upper) if math.isfinite(parameter.upper) else reach
    return min(low, math.floor(shown)), max(high, math.ceil(shown))


def _slider(gui: viser.GuiApi, parameter: Parameter, value: float) -> viser.GuiSliderHandle[float]:
    shown = shown_value(parameter, value)
    low, high = slider_limits(parameter, shown)
    unit, step = ("°", _STEP_DEG) if parameter.kind == "angle" else ("mm", _STEP_MM)
    hint = f"{parameter.name}: {low:g} to {high:g} {unit}."
    return gui.add_slider(f"{parameter.label} ({unit})", low, high, step, shown, hint=hint)


def _entry_change(index: int, parameter: Parameter) -> Change:
    def change(model: Model, shown: float) -> Model:
        return edit_pose(model, lambda edit: entry_moved(edit, index, stored_value(parameter, float(shown))))

    return change


def _about(model: Model, edit: PoseEdit) -> str:
    if edit.frame is None:
        return f"Start pose of **{model.selection.session}**"
    return f"Frame **{edit.frame}** of **{model.selection.run}**, corrected"
