"""The Show tab: what is drawn in the scene, and what its colours mean."""

from collections.abc import Callable
from dataclasses import replace
from html import escape
from typing import Any

import viser

from studio.body.model import BodyModel, extremities
from studio.runs.colour_tokens import ColourTokens
from studio.runs.overlay_drawing import OVERLAYS
from studio.runs.tracks import RAW
from studio.scene.trail_view import extremity_markers
from studio.scene.view_options import ViewOptions

ALL_LAYERS: str = "all together"
_OVERLAY_WORDS = {"mask": "mask", "edges": "edge map", "samples": "sample points", "outline": "outlines"}
_SWITCHES = (
    ("body", "body", "The answer's cones: left limbs cyan, right limbs yellow, torso and head magenta."),
    ("truth", "truth", "The reference as a stick figure, where the session has one."),
    ("stored", "stored answer", "The stored answer as a grey cage while a re-annealed one is shown."),
    ("particles", "particles", "Every layer's own particles at the chosen limb ends."),
    ("trails", "trails", "Where the chosen joints went."),
    ("cameras", "cameras", "The cameras; click one to look through it."),
    ("pictures", "pictures", "The pictures on the cameras."),
    (
        "hull",
        "visual hull",
        "What the silhouettes leave of space in this frame, as voxels in their mean colours; with the body over it.",
    ),
    (
        "blobs",
        "coloured blobs",
        "Blobs fitted to the voxels, in the colours learnt; as cages those that the shown pose has of itself.",
    ),
)


class ShowPanel:
    """options : what is shown. changed : called with what is to be shown otherwise, by name.

    layer_chosen : called with a layer, or None for all.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        tab: viser.GuiTabHandle,
        changed: Callable[[dict[str, object]], None],
        layer_chosen: Callable[[int | None], None],
    ) -> None:
        self._gui = gui
        self._tab = tab
        self._changed = changed
        self._layer_chosen = layer_chosen
        self.options = ViewOptions()
        self.inputs: dict[str, Any] = {}
        self._lists: list[viser.GuiFolderHandle] = []
        self._defaults: dict[str, tuple[str, ...]] = {}
        with tab:
            self.legend = gui.add_html("")
            self.layer = gui.add_dropdown("layer", (ALL_LAYERS,), hint="One layer's cloud, or all together.")
            self.layer.on_update(self._layer_updated)
            self._build_choices()
            for name, label, help_text in _SWITCHES:
                self._switch(name, label, help_text)
            self._slider("body_opacity", "body opacity", 0.1, 1.0, 0.05, "How solid the cones are.")
            self._slider(
                "point_size", "point size (mm)", 2, 40, 1, "Width of a particle's point.", scale=0.001
            )
            self._slider(
                "trail_frames", "trail length (frames)", 0, 300, 5, "On either side; 0: the whole run."
            )
            self._build_overlays()

    def show_body(self, body: BodyModel) -> None:
        """Offer the limbs and markers of a body."""
        for folder in self._lists:
            folder.remove()
        self._lists = []
        limbs = tuple(limb.name for limb in body.drawn)
        tips = tuple(limbs[index] for index in extremities(body))
        self._defaults = {"limbs": tips, "trail_markers": extremity_markers(body)}
        with self._tab:
            self._checklist("Limb ends with particles", "limbs", limbs)
            self._checklist(
                "Joints with trails", "trail_markers", tuple(marker.name for marker in body.markers)
            )

    def offer_blobs(self, offered: bool) -> None:
        """Offer the blobs, or do not: only a run that is weighed by them has any."""
        self.inputs["blobs"][0].visible = offered

    def offer_tracks(self, names: tuple[str, ...]) -> None:
        """Offer the run's tracks and show which is chosen; only where there is more than what the search found."""
        chosen = self.options.track if self.options.track in names else RAW
        if self.track.options != names:
            self.track.options = names
        if self.track.value != chosen:
            self.track.value = chosen
        self.track.visible = len(names) > 1

    def show_layers(self, count: int, layer: int | None) -> None:
        """Offer so many layers and show which is chosen."""
        names = (ALL_LAYERS, *(f"layer {index + 1}" for index in range(count)))
        chosen = ALL_LAYERS if layer is None or layer >= count else names[layer + 1]
        if self.layer.options != names:
            self.layer.options = names
        if self.layer.value != chosen:
            self.layer.value = chosen

    def show_options(self, options: ViewOptions) -> None:
        """Show options that are in use, without asking for them again."""
        self.options = options
        for name, (handle, scale) in self.inputs.items():
            value = getattr(options, name)
            shown = value if scale is None else type(handle.value)(round(value / scale))
            if handle.value != shown:
                handle.value = shown

    def show_legend(self, tokens: ColourTokens, layers: int, truth: bool) -> None:
        """Say what the colours mean."""
        self.legend.content = legend_html(tokens, self.options.colour_by, layers, truth)

    def _switch(self, name: str, label: str, help_text: str) -> None:
        handle = self._gui.add_checkbox(label, bool(getattr(self.options, name)), hint=help_text)
        self._wire(name, handle, None)

    def _slider(
        self,
        name: str,
        label: str,
        low: float,
        high: float,
        step: float,
        help_text: str,
        scale: float | None = None,
    ) -> None:
        value = getattr(self.options, name) / (scale or 1.0)
        value = type(low)(round(value)) if scale is not None else type(low)(value)
        self._wire(name, self._gui.add_slider(label, low, high, step, value, hint=help_text), scale)

    def _build_choices(self) -> None:
        handle = self._gui.add_dropdown(
            "colour by",
            ("layer", "weight"),
            hint="Layers from cool (first) to warm (last), or weights from low to high.",
        )
        self._wire("colour_by", handle, None)
        self.track: viser.GuiDropdownHandle[Any] = self._gui.add_dropdown(
            "poses", (RAW,), hint="As the search found them, or a track made of them: refined, smoothed, …"
        )
        self.track.on_update(self._track_updated)

    def _build_overlays(self) -> None:
        with self._gui.add_folder("Over the pictures"):
            for name in OVERLAYS:
                label = _OVERLAY_WORDS.get(name, name)
                handle = self._gui.add_checkbox(label, name in self.options.overlays)
                handle.on_update(self._listed("overlays", name))

    def _checklist(self, title: str, field: str, names: tuple[str, ...]) -> None:
        folder = self._gui.add_folder(title, expand_by_default=False)
        self._lists.append(folder)
        chosen = getattr(self.options, field)
        with folder:
            for name in names:
                ticked = name in (self._defaults[field] if chosen is None else chosen)
                self._gui.add_checkbox(name, ticked).on_update(self._listed(field, name))

    def _listed(self, field: str, name: str) -> Callable[[viser.GuiEvent], Any]:
        async def updated(event: viser.GuiEvent) -> None:
            chosen = getattr(self.options, field)
            names = list(self._defaults.get(field, ()) if chosen is None else chosen)
            if event.target.value and name not in names:
                names.append(name)
            elif not event.target.value and name in names:
                names.remove(name)
            self._take(**{field: tuple(names)})

        return updated

    def _wire(self, name: str, handle: Any, scale: float | None) -> None:  # noqa: ANN401 - any input handle
        async def updated(event: viser.GuiEvent) -> None:
            value = event.target.value
            self._take(**{name: value if scale is None else value * scale})

        self.inputs[name] = (handle, scale)
        handle.on_update(updated)

    def _take(self, **changes: object) -> None:
        wanted = replace(self.options, **changes)  # pyright: ignore[reportArgumentType]
        if wanted != self.options:
            self.options = wanted
            self._changed(changes)

    async def _track_updated(self, event: viser.GuiEvent) -> None:
        self._take(track=event.target.value)

    async def _layer_updated(self, event: viser.GuiEvent) -> None:
        chosen = event.target.value
        self._layer_chosen(None if chosen == ALL_LAYERS else int(chosen.removeprefix("layer ")) - 1)


def legend_html(tokens: ColourTokens, colour_by: str, layers: int, truth: bool) -> str:
    """The legend as HTML: the ramp with its ends named, the limbs' sides, the truth."""
    count = max(2, min(layers, 24)) if colour_by == "layer" else 12
    swatches = "".join(
        f'<span style="flex:1;background:{_css(tokens.layer(index, count))}"></span>'
        for index in range(count)
    )
    ends = ("layer 1", f"layer {layers}") if colour_by == "layer" else ("lowest weight", "highest weight")
    sides = [
        ("left", tokens["limb-left"]),
        ("right", tokens["limb-right"]),
        ("middle", tokens["limb-middle"]),
    ]
    if truth:
        sides.append(("truth", tokens["truth"]))
    dots = "".join(
        f'<span style="display:inline-flex;align-items:center;gap:4px"><span style="width:9px;height:9px;'
        f'border-radius:50%;border:1px solid #8886;background:{_css(colour)}"></span>{escape(name)}</span>'
        for name, colour in sides
    )
    return (
        '<div style="padding:2px 10px 6px;font-size:12px;opacity:.92">'
        f'<div style="display:flex;height:10px;border-radius:3px;overflow:hidden">{swatches}</div>'
        f'<div style="display:flex;justify-content:space-between;margin:2px 0 6px">'
        f"<span>{ends[0]}</span><span>{ends[1]}</span></div>"
        f'<div style="display:flex;justify-content:space-between">{dots}</div></div>'
    )


def _css(colour: tuple[int, int, int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
