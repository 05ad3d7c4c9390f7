"""The papers' presets beside what the papers print, typed here a second time from their text."""

from dataclasses import replace

import pytest

from studio.body.catalogue import load_body
from studio.foundations.knobs import changed, knobs_of
from studio.search.behaviour.settings import LearningSettings
from studio.search.settings import RunSettings, changed_settings, default_settings, values
from studio.search.trackers.catalogue import TRACKERS, presets
from studio.search.trackers.paper_presets import CAILLETTE, PAPERS, of_the_search
from studio.search.trackers.tracker import Preset

SEARCH_ALONE = {"refine_frames": False, "redraw_limbs": False, "start_repeats": 1}
EDGES_AND_REGION = {"edge_weight": 1.0, "region_weight": 1.0, "occlusion_aware": False}  # Eq. 16 and 17
FILTER = (
    SEARCH_ALONE
    | EDGES_AND_REGION
    | {
        "recovery": "off",
        "layers": 10,  # Figs. 9 and 10
        "particles": 200,
        "survival": 0.5,  # 3.1
        "survival_per_layer": "",
        "diffusion_scale": 1.0,
        "resampling": "multinomial",  # step 4: drawn randomly with replacement
        "estimate": "mean",  # Eq. 8
        "carry": "weighted",  # Eq. 9
        "dynamics": "none",
        "prediction": "noise",
        "constraints": "ignore",
        "limbs_apart": False,
    }
)
PRINTED = {
    "paper, Eq. 13": (
        ("annealed", "edge-region", 29),
        FILTER | {"adaptive_diffusion": False, "diffusion_decay": "printed", "crossover": 0.0},
    ),
    "paper, Eq. 18 and 19": (
        ("annealed", "edge-region", 34),
        FILTER
        | {"adaptive_diffusion": True, "diffusion_form": "paper", "diffusion_covariance": "full"}  # Eq. 18
        | {
            "crossover": 1.0,
            "crossover_by": "parameters",
        },  # 6.2.1: the i-th particle is created by drawing two
    ),
    "paper, swarm": (
        ("swarm", "edge-silhouette", 31),
        SEARCH_ALONE
        | {"recovery": "off", "silhouette_resolution": "full"}
        | {"stage1_particles": 10, "stage1_iterations": 20, "stage2_particles": 20, "stage2_iterations": 40}
        | {"c_first": 2.05, "c_last": 2.15}  # Eq. 2
        | {"partition": "soft", "position_divisor": 10.0}  # 2.4
        | {"start_velocity": "uniform", "constraints": "redraw", "limbs_apart": True}  # 2.3, Algorithm 1
        | {"dynamics": "none", "prediction": "noise", "estimate": "mode", "diffusion_scale": 1.0},
    ),
    "paper, learnt behaviour": (
        ("behaviour", "blobs", 25),
        SEARCH_ALONE
        | {
            "recovery": "spread",
            "lost_after": 1,
            "recovery_interval": 1,
        }  # 6.3: states reset where the fit is poor
        | {"particles": 1000, "estimate": "mode", "resampling": "multinomial"}  # 7.3, 3.3
        | {"automaton_share": 0.0, "entering": "resample", "root_prediction": "noise"}  # Eq. 3, 5.1, 5.2
        | {"model_free_share": 0.0, "model_free_grows": False, "online_learning": False}  # 7.5, 8
        | {"selection": "weights", "blob_sharpness": 1.0}  # 6.4: proportional to the inverse
        | {
            "hull_confidence": 0.99,
            "hull_sampling": 1.0,
            "hull_shadow": 0.1,
            "hull_deepest_shadow": 0.0,
        }  # 6.1
        | {"constraints": "clamp", "limbs_apart": False},  # 3.1: bounding values
    ),
}
OPEN = {
    # What the papers leave open, and what says nothing where it stands.
    "edge_samples", "region_samples", "samples_per_edge", "fitness_scale", "device", "diffusion_constant",
    "attenuation", "global_scale", "hull_depth", "hull_edge_share", "hull_least_views", "expected_support",
    "expected_most", "blob_starts", "blob_lost", "blob_iterations", "blob_learning", "blob_split", "blob_parts",
    "record_particles",
}  # fmt: skip
UNUSED = {
    "no adaptive noise": {"diffusion_form", "diffusion_fraction", "diffusion_constant", "diffusion_covariance"},
    "no crossover": {"crossover_by"},
    "Eq. 18 as printed": {"diffusion_fraction", "diffusion_decay"},
    "no model": {
        "attenuation", "entering", "root_prediction", "root_spread", "global_scale", "automaton_share",
        "model_free_share", "model_free_grows", "online_learning", "learning_overlap", "learning_interval",
    },
    "weights as they are": {"survival", "root_spread", "learning_overlap", "learning_interval", "diffusion_scale"},
    "nothing refined": {
        "refine_frame_steps", "refine_frame_points", "limb_colours", "thin_limbs", "ask_network_every",
        "above_floor",
        "refined_spread", "next_frame_from",
    },
    "no recovery": {"lost_after", "recovery_interval"},
}  # fmt: skip


def settings_of(preset: Preset) -> RunSettings:
    return changed_settings(default_settings(preset.tracker, preset.weighting), preset.values)


@pytest.mark.parametrize("name", PRINTED)
def test_a_paper_preset_is_the_whole_tracker_that_is_printed(name: str) -> None:
    preset = next(one for one in PAPERS if one.name == name)
    (tracker, weighting, parameters), printed = PRINTED[name]
    assert (preset.tracker, preset.weighting) == (tracker, weighting)
    assert len(load_body(preset.body).parameters) == parameters
    settings = settings_of(preset)
    now = values(settings)
    assert {knob: now[knob] for knob in printed} == printed
    # Every knob that acts is printed, or known to be open: nothing of the studio's own stays on.
    evidence = {knob.name for knob in knobs_of(settings.evidence)}
    unused = UNUSED["nothing refined"] | evidence | OPEN
    if tracker == "behaviour":
        unused |= UNUSED["weights as they are"]
    else:
        unused |= UNUSED["no model"] | UNUSED["no recovery"]
    if now.get("adaptive_diffusion") is True:
        unused |= UNUSED["Eq. 18 as printed"]
    elif tracker == "annealed":
        unused |= UNUSED["no adaptive noise"] | UNUSED["no crossover"]
    assert set(now) - set(printed) <= unused


def test_what_is_not_as_printed_says_why() -> None:
    for preset in PAPERS:
        for entry in (*preset.printed, *preset.learning):
            assert entry.sets or entry.runs or entry.printed == "Nothing else"
            if "not printed" in entry.why or set(entry.sets) & OPEN:
                assert entry.why, (preset.name, entry.printed)
    learnt = changed(
        LearningSettings(), {k: v for entry in CAILLETTE.learning for k, v in entry.sets.items()}
    )
    assert (learnt.memory, learnt.reduced_dimensions, learnt.cluster_floor, learnt.back_off) == (
        20,
        0,
        0.0,
        0.0,
    )
    # What 122 clusters and 948 and 2890 states make of what is not printed.
    assert (learnt.covariance, learnt.epsilon, learnt.least_probability) == ("diagonal", 2.0, 0.0)


def test_a_papers_variant_searches_as_its_preset() -> None:
    """What is compared under the paper's name is the paper's search, at any number of evaluations."""
    for label, preset in (("eq13", PAPERS[0]), ("paper", PAPERS[1])):
        changes = TRACKERS["annealed"].variants[label].changes
        found = changed_settings(default_settings("annealed", preset.weighting), changes).tracker
        wanted = settings_of(preset).tracker
        same = {"layers": found.layers, "particles": found.particles, "start_repeats": found.start_repeats}
        assert found == replace(wanted, **same)
        assert changes == of_the_search(preset)


def test_presets_fit_the_runs_that_they_are_made_for() -> None:
    for preset in presets():
        assert preset.tracker in TRACKERS
        assert preset.fits(preset.tracker, preset.weighting or "edge-region")
        assert not preset.fits("condensation", preset.weighting)
