"""The start pose under sliders: six for the root, one for every angle, in degrees and mm; the overlays
follow.
"""

import math
from collections.abc import Callable

import numpy as np
import viser
from numpy.typing import NDArray

from studio.body.model import BodyModel, Parameter

Array = NDArray[np.float64]

_REACH_MM = 3000.0
_FREE_ANGLE_DEG = 180.0
_STEP_DEG, _STEP_MM = 0.5, 5.0


class PoseEditor:
    """moved : called with the pose while it is edited, None when editing ends. save : stores a pose for the
    session, raising StudioError; said : tells the person a sentence. original : where `reset` goes back to.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        tab: viser.GuiTabHandle,
        moved: Callable[[Array | None], None],
        save: Callable[[Array], None],
    ) -> None:
        self._gui = gui
        self._tab = tab
        self._moved = moved
        self._save = save
        self._body: BodyModel | None = None
        self._folders: list[viser.GuiFolderHandle] = []
        self._original = np.zeros(0)
        self.pose = np.zeros(0)
        self.sliders: list[viser.GuiSliderHandle[float]] = []
        with tab:
            self.editing = gui.add_checkbox(
                "edit the start pose", False, hint="Show it in the scene and on the pictures."
            )
            self.save = gui.add_button("Save as the session's start pose", disabled=True)
            self.reset = gui.add_button("Back to the stored start pose", color="gray", disabled=True)
        self.editing.on_update(self._editing_ticked)
        self.save.on_click(self._save_clicked)
        self.reset.on_click(self._reset_clicked)

    def show_body(self, body: BodyModel, pose: Array) -> None:
        """Offer the sliders of a body, standing at a pose (D,) in radians and mm."""
        self._body, self._original, self.pose = body, pose.copy(), pose.copy()
        for folder in self._folders:
            folder.remove()
        self._folders, self.sliders = [], []
        groups: dict[str, list[int]] = {}
        for index, parameter in enumerate(body.parameters):
            groups.setdefault(parameter.limb, []).append(index)
        with self._tab:
            for number, (limb, indices) in enumerate(groups.items()):
                folder = self._gui.add_folder(limb.replace("_", " "), expand_by_default=number == 0)
                self._folders.append(folder)
                with folder:
                    for index in indices:
                        self.sliders.append(self._slider(body.parameters[index], index, float(pose[index])))
        if self.editing.value:
            self.editing.value = False
        self._dress()

    def show_pose(self, pose: Array) -> None:
        """Put the sliders at a pose."""
        self.pose = pose.copy()
        if self._body is None:
            return
        for slider, parameter, value in zip(self.sliders, self._body.parameters, pose, strict=True):
            shown = min(max(shown_value(parameter, float(value)), slider.min), slider.max)
            if abs(slider.value - shown) > 1e-9:
                slider.value = shown
        self._dress()

    def propose(self, pose: Array) -> None:
        """Put the sliders at a pose that somebody else found, ready to be looked at, changed and saved."""
        self.show_pose(pose)
        self._edited()

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
            wanted = stored_value(parameter, float(event.target.value))
            held = min(max(shown_value(parameter, float(self.pose[index])), low), high)
            if abs(float(event.target.value) - held) > 1e-6:
                self.pose = self.pose.copy()
                self.pose[index] = wanted
                self._edited()

        slider.on_update(updated)
        return slider

    def _edited(self) -> None:
        if not self.editing.value:
            self.editing.value = True
        self._moved(self.pose)
        self._dress()

    async def _editing_ticked(self, event: viser.GuiEvent) -> None:
        self._moved(self.pose if event.target.value else None)

    async def _save_clicked(self, _: viser.GuiEvent) -> None:
        self._save(self.pose)

    async def _reset_clicked(self, _: viser.GuiEvent) -> None:
        self.show_pose(self._original)
        self._edited()

    def saved(self) -> None:
        """Take note that the pose was stored: it is what `reset` goes back to now."""
        self._original = self.pose.copy()
        self._dress()

    def _dress(self) -> None:
        moved = len(self.pose) > 0 and not np.array_equal(self.pose, self._original)
        self.save.disabled = self.reset.disabled = not moved


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
