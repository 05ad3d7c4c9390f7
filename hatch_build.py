"""What travels in the wheel beside the package: pages and samples. Editable installs read them in place."""

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

SAMPLES = ("walk", "planar_arm", "branched_arms")
TRAVELS = {
    "web_assets": "studio/app/assets",
    **{f"sample_sessions/{name}": f"studio/sessions/samples/{name}" for name in (*SAMPLES, "prepared")},
}


class PagesAndSamples(BuildHookInterface):
    """Adds them to a standard wheel only: copies beside an editable install would hide later changes."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict) -> None:
        """Called by hatchling before a wheel is made."""
        if version == "standard":
            build_data["force_include"].update(TRAVELS)
