"""The particles that the store has of a frame, beside those that the browser was told to draw."""

import numpy as np
from studio_page import StudioPage

from studio.body.forward_kinematics import limb_ends
from studio.body.model import extremities
from studio.sessions.workspace import Workspace


def run_path(window: StudioPage) -> str:
    return f"/api/sessions/{window.get('session')}/runs/{window.get('run')}"


def stored_clouds(window: StudioPage, frame: int) -> dict[int, np.ndarray]:
    """The extremities of the particles that the API gives, metres, by layer: what the scene has to draw."""
    run = Workspace(window.studio.workspace).session(str(window.get("session"))).run(str(window.get("run")))
    body, count = run.body(), len(window.studio.get(f"{run_path(window)}/frames/{frame}")["layers"])
    clouds = {}
    for layer in range(count):
        response = window.studio.get(f"{run_path(window)}/frames/{frame}/layers/{layer}/particles")
        ends = limb_ends(body, np.array(response["poses"]))[:, list(extremities(body)), 1]
        clouds[layer] = ends.reshape(-1, 3) / 1000.0
    return clouds


def differing(shown: dict[int, np.ndarray], clouds: dict[int, np.ndarray]) -> set[int] | None:
    """The layers whose clouds are others; None while another number of layers is shown."""
    if shown.keys() != clouds.keys():
        return None
    return {
        layer
        for layer, cloud in clouds.items()
        if shown[layer].shape != cloud.shape or not np.allclose(shown[layer], cloud, atol=1e-5)
    }


def drawn(window: StudioPage, clouds: dict[int, np.ndarray]) -> bool:
    """Whether the browser was told to draw exactly these clouds."""
    return differing(window.wire.layers(), clouds) == set()
