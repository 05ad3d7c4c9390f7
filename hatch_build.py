"""What travels in the wheel beside the package: pages and one sample. Editable installs read them in place."""

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

TRAVELS = {"web_assets": "studio/web/assets", "sample_sessions/walk": "studio/sessions/samples/walk"}


class PagesAndSample(BuildHookInterface):
    """Adds them to a standard wheel only: copies beside an editable install would hide later changes."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict) -> None:
        """Called by hatchling before a wheel is made."""
        if version == "standard":
            build_data["force_include"].update(TRAVELS)
