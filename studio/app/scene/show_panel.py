"""The Show tab: the content of the scene, and a legend of its colours."""

from collections.abc import Callable
from html import escape
from typing import Any

import viser

from studio.app.scene.controls import Control, Post, take_out
from studio.app.scene.frame_volume import has_blobs
from studio.app.scene.model import Model, Subject, change_options, tick_listed
from studio.app.scene.opened_run import Moment
from studio.body.model import BodyModel
from studio.runs.drawing.colour_tokens import ColourTokens
from studio.runs.drawing.overlay_drawing import OVERLAYS

OVERLAY_WORDS = {
    "edges": "edge map",
    "samples": "sample points",
    "outline": "outlines",
    "filled": "filled bodies",
    "cost": "cost of the samples",
}
SWITCHES = (
    ("body", "body", "The body's cones: left limbs cyan, right limbs yellow, torso and head magenta."),
    ("truth", "truth", "The reference as a stick figure, where the session has one."),
    ("stored", "stored result", "The stored result as a grey cage while a re-annealed one is shown."),
    ("particles", "particles", "Every layer's own particles at the chosen limb ends."),
    ("shells", "earlier layers", "Beside the layer that is looked at the ones before it, as small points."),
    ("skeletons", "heaviest particles", "The twenty heaviest particles of that layer as stick figures."),
    ("lines", "ways of a limb", "The ways of the chosen limb's particles through the layers; click a limb."),
    ("trails", "trails", "Paths of the chosen joints; hidden while a layer is looked at."),
    ("cameras", "cameras", "The cameras; click one to choose it, twice to look through it."),
    ("pictures", "pictures", "The pictures on the cameras."),
    ("shadows", "shadows", "Shadows and reflected light; left out at first without a graphics card."),
    (
        "hull",
        "visual hull",
        "The visual hull of this frame as voxels in their mean colours, with the body over it.",
    ),
    (
        "blobs",
        "coloured blobs",
        "Blobs fitted to the voxels, in their learnt colours; as cages those of the shown pose.",
    ),
)
POINT_SIZE = "point_size"


class ShowPanel:
    """The tab's controls; those of limbs and markers are made for the body that is open."""

    def __init__(self, gui: viser.GuiApi, tab: viser.GuiTabHandle, post: Post) -> None:
        self._gui, self._tab, self._post = gui, tab, post
        self._body: BodyModel | None = None
        self._lists: list[viser.GuiFolderHandle] = []
        self.inputs: dict[str, Control] = {}
        self.ticks: dict[tuple[str, str], Control] = {}
        with tab:
            self.legend = gui.add_html("")
            colours = "Layers from cool (first) to warm (last), or weights from low to high."
            self._add("colour_by", gui.add_dropdown("colour by", ("layer", "weight"), hint=colours))
            for name, label, hint in SWITCHES:
                self._add(name, gui.add_checkbox(label, False, hint=hint))
            opacity = gui.add_slider("body opacity", 0.1, 1.0, 0.05, 1.0, hint="How solid the cones are.")
            self._add("body_opacity", opacity)
            size = gui.add_slider("point size (mm)", 2, 40, 1, 2, hint="Width of a particle's point.")
            self._add(POINT_SIZE, size, lambda millimetres: millimetres * 0.001)
            length = gui.add_slider(
                "trail length (frames)", 0, 300, 5, 0, hint="On either side; 0: the whole run."
            )
            self._add("trail_frames", length)
            with gui.add_folder("Over the pictures"):
                for name in OVERLAYS:
                    self._add_tick("overlays", name, OVERLAY_WORDS.get(name, name))

    def show(self, model: Model, moment: Moment | None, tokens: ColourTokens) -> None:
        """Show the options in use and what the colours of a moment mean."""
        options, subject, knobs = model.options, model.subject, model.knobs
        for name, control in self.inputs.items():
            value = getattr(options, name)
            control.show(round(value / 0.001) if name == POINT_SIZE else value)
        if subject is None or knobs is None or moment is None:
            return
        if subject.body is not self._body:
            self._list_body(subject)
        for (name, entry), control in self.ticks.items():
            control.show(entry in subject.listed(name, options))
        self.inputs["blobs"].handle.visible = model.selection.run != "" and has_blobs(knobs.settings)
        layers = max(1, moment.layer_count)
        self.legend.content = legend_html(tokens, options.colour_by, layers, moment.truth is not None)

    def _list_body(self, subject: Subject) -> None:
        for folder in self._lists:
            take_out(folder)
        self.ticks = {key: control for key, control in self.ticks.items() if key[0] == "overlays"}
        self._body, self._lists = subject.body, []
        for title, name, entries in (
            ("Limb ends with particles", "limbs", [limb.name for limb in subject.body.drawn]),
            ("Joints with trails", "trail_markers", [marker.name for marker in subject.body.markers]),
        ):
            with self._tab:
                self._lists.append(self._gui.add_folder(title, expand_by_default=False))
            with self._lists[-1]:
                for entry in entries:
                    self._add_tick(name, entry, entry)

    def _add(
        self,
        name: str,
        handle: viser.GuiInputHandle[Any],
        meant: Callable[[float], object] = lambda value: value,
    ) -> None:
        """meant : converts an input's value to the option's."""
        self.inputs[name] = Control(
            handle, self._post, lambda model, value: change_options(model, {name: meant(value)})
        )

    def _add_tick(self, name: str, entry: str, label: str) -> None:
        self.ticks[name, entry] = Control(
            self._gui.add_checkbox(label, False),
            self._post,
            lambda model, ticked: tick_listed(model, name, entry, ticked),
        )


def legend_html(tokens: ColourTokens, colour_by: str, layers: int, truth: bool) -> str:
    """The ramp with its ends named, the limbs' sides, the truth."""
    count = max(2, min(layers, 24)) if colour_by == "layer" else 12
    swatches = "".join(
        f'<span style="flex:1;background:{css(tokens.layer(index, count))}"></span>' for index in range(count)
    )
    ends = ("layer 1", f"layer {layers}") if colour_by == "layer" else ("lowest weight", "highest weight")
    sides = [(side, tokens[f"limb-{side}"]) for side in ("left", "right", "middle")]
    dots = "".join(
        f'<span style="display:inline-flex;align-items:center;gap:4px"><span style="width:9px;height:9px;'
        f'border-radius:50%;border:1px solid #8886;background:{css(colour)}"></span>{escape(name)}</span>'
        for name, colour in [*sides, *([("truth", tokens["truth"])] if truth else [])]
    )
    return (
        '<div style="padding:2px 10px 6px;font-size:12px;opacity:.92">'
        f'<div style="display:flex;height:10px;border-radius:3px;overflow:hidden">{swatches}</div>'
        f'<div style="display:flex;justify-content:space-between;margin:2px 0 6px">'
        f"<span>{ends[0]}</span><span>{ends[1]}</span></div>"
        f'<div style="display:flex;justify-content:space-between">{dots}</div></div>'
    )


def css(colour: tuple[int, int, int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
