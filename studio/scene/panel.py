"""viser's panel as a whole: the run on top, under it tabs for Search, Show, Weighting, Masks and Start
pose.
"""

from collections.abc import Mapping
from typing import Protocol

import numpy as np
import viser

from studio.errors import StudioError
from studio.knobs import Value
from studio.runs.colour_tokens import ColourTokens
from studio.scene.pose_editor import PoseEditor, PoseWishes
from studio.scene.run_panel import RunPanel, Transport
from studio.scene.settings_panel import SettingsPanel, SettingsTabs
from studio.scene.show_panel import ShowPanel
from studio.scene.wishes import Wishes

PANEL_WIDTH = 310


class Director(Transport, Protocol):
    """What the panel's callbacks post their wishes to."""

    wishes: Wishes

    @property
    def posing(self) -> PoseWishes:
        """Where poses are edited."""
        ...

    def change_settings(self, changes: dict[str, Value]) -> str:
        """Ask for knobs; the identifier of the answer. Raises StudioError if it cannot be asked."""
        ...

    def change_options(self, changes: Mapping[str, object]) -> None:
        """Show other things."""
        ...

    def choose_layer(self, layer: int | None) -> None:
        """Show one layer's cloud, or all."""
        ...

    def refused(self, problem: StudioError) -> None:
        """Tell the person about a refusal."""
        ...


class Panel:
    """All controls, wired to a director."""

    def __init__(self, server: viser.ViserServer, director: Director) -> None:
        gui = server.gui
        gui.main_panel.dock_right()
        gui.main_panel.set_width(PANEL_WIDTH)
        self.run = RunPanel(
            gui,
            gui.add_folder("Track and play", expand_by_default=False),
            director.wishes,
            transport=director,
            refused=director.refused,
        )
        tabs = gui.add_tab_group()
        search, show = tabs.add_tab("Search"), tabs.add_tab("Show")
        weighting, masks, pose = tabs.add_tab("Weighting"), tabs.add_tab("Masks"), tabs.add_tab("Pose")
        self.settings = SettingsPanel(
            gui, SettingsTabs(search, weighting, masks), director.change_settings, director.refused
        )
        self.show = ShowPanel(gui, show, director.change_options, director.choose_layer)
        self.pose = PoseEditor(gui, pose, director.posing)


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


def tell(server: viser.ViserServer, title: str, body: str, *, bad: bool = False) -> None:
    """Show every viewer a notification that goes away by itself."""
    for client in server.get_clients().values():
        client.add_notification(
            title, body, auto_close_seconds=8.0 if bad else 4.0, color="red" if bad else "green"
        )
