"""The knobs of masks and edge maps. All take effect with the next frame, or when a frame is re-annealed."""

from dataclasses import dataclass

from studio.evidence.yuv_background import LEAST_NOISE
from studio.foundations.knobs import next_frame_knob

BACKGROUND_MODELS = ("auto", "mask", "gaussian", "median", "combined", "mog2", "knn", "threshold")
HULL_EVIDENCE = ("auto", "pixels", "masks")


@dataclass(frozen=True, slots=True)
class EvidenceSettings:
    """How pictures become masks (section 4.2.2) and edge proximity maps (section 4.2.1)."""

    title = "Masks and edges"

    background_model: str = next_frame_knob(
        "auto",
        label="masks from",
        choices=BACKGROUND_MODELS,
        help="mask: the masks that came with the footage; gaussian: difference from the plate or empty clip,"
        " else from the footage's median; median: from the footage's median; combined: the plate where the footage"
        " confirms it, else the footage's most frequent colour; mog2, knn: OpenCV's"
        " models, trained on the empty clip, else on the footage; threshold: by brightness and colour; auto: masks that"
        " came with it, else gaussian.",
    )
    mask_threshold: float = next_frame_knob(
        4.0,
        0.5,
        30.0,
        0.25,
        label="mask threshold",
        unit="σ",
        help="Pixels that differ from the background by more than this many standard deviations are foreground.",
    )
    mask_noise: float = next_frame_knob(
        4.0,
        0.5,
        40.0,
        0.5,
        label="camera noise",
        unit="grey levels",
        help="Smallest standard deviation of a background pixel; raise it where the light flickers.",
    )
    mask_gain_fit: bool = next_frame_knob(
        True,
        label="fit colours per frame",
        help="Scale each colour of the background to each frame first: plates may be exposed differently, and cameras"
        " and lamps change while they run.",
    )
    mask_shadow_test: bool = next_frame_knob(
        True,
        label="shadow test",
        help="Count pixels that are only darker than the background, in its own colour, as background.",
    )
    # Ten drawn clips of the choosing half, one seed, mean error: 14.1 mm at 0.5, 13.3 at 0.4, as much at 0.35; at 0.25
    # trousers become shadow. What is darker under the feet counts as body and pulls it down.
    mask_shadow_darkest: float = next_frame_knob(
        0.4,
        0.1,
        0.95,
        0.05,
        label="darkest shadow",
        help="A shadow leaves at least this share of the background's brightness.",
    )
    # Masks of 13 drawn clips and two of others (`studio reproduce shadow-test`), body called background: 1.5 % (worst
    # clip 12.3) with each pixel alone and 0.04, 0.6 (2.7) with five and 0.025; beside it called body 0.07 and 0.08. At
    # 0.015 tinted shadows count as body (9 % of it), at 0.02 the deepest beside a foot, which pull it; at 0.03 forearms
    # go.
    mask_shadow_colour: float = next_frame_knob(
        0.025,
        0.005,
        0.5,
        0.005,
        label="shadow colour tolerance",
        help="How far a shadow's colour may lie from the background's, as a share of its brightness.",
    )
    mask_shadow_window: int = next_frame_knob(
        5,
        1,
        15,
        2,
        label="shadow colour over",
        unit="px",
        help="A shadow's colour is that of the changed pixels in a square of this side: one pixel's is mostly noise."
        " 1 = each pixel alone.",
    )
    # Two clips of others (`studio reproduce shadow-test`), body called background: 2.7 and 0.65 % without, 1.4 and 0.33
    # with it; beside it called body as before on 13 of 15 clips, 1.3 % more where a shadow falls on a stool.
    mask_shadow_floor: bool = next_frame_knob(
        True,
        label="shadows lie on the floor",
        help="What looks like a shadow is none if another camera sees the floor there empty and something above the"
        " floor can be what all cameras see. Needs two cameras or more above a floor at z = 0.",
    )
    # Twelve drawn clips in the colours of their rooms (`studio reproduce shadow-test`), body called background: 5.9 %
    # without, 4.3 at 0.1, 4.0 at 0.05; shadows called body 0.26, 0.39 and 0.41. Cameras differ by more than drawn ones.
    mask_shadow_alike: float = next_frame_knob(
        0.1,
        0.0,
        1.0,
        0.01,
        label="shadows alike within",
        help="A shadow on the floor is as dark for every camera: what differs by more than about this share from what"
        " the others see there is none. 0 = it is not asked.",
    )
    # The same twelve people, body called background: 4.3 % without, 3.1 with it (worst 10.4 and 7.9), 0.6 neither; of
    # shadows 0.4 and 0.5 % called body, 0.9 neither. Two clips of others, tracked: 15.1 and 16.5 mm, 16.0 and 16.2.
    mask_shadow_doubt: bool = next_frame_knob(
        True,
        label="shadows may be doubted",
        help="What only one other camera sees as a shadow, and what none confirms, is neither subject nor background"
        " where something above the floor may be there: it counts half.",
    )
    mask_darkest: int = next_frame_knob(
        128,
        0,
        255,
        1,
        label="darkest of the subject",
        unit="grey levels",
        help="Where masks are made by threshold: darker pixels are not the subject.",
    )
    mask_brightest: int = next_frame_knob(
        255,
        0,
        255,
        1,
        label="brightest of the subject",
        unit="grey levels",
        help="Where masks are made by threshold: brighter pixels are not the subject.",
    )
    mask_hue: float = next_frame_knob(
        0.0,
        0.0,
        360.0,
        5.0,
        label="hue of the subject",
        unit="°",
        help="Where masks are made by threshold: 0 red, 60 yellow, 120 green, 180 cyan, 240 blue, 300 magenta.",
    )
    mask_hue_reach: float = next_frame_knob(
        180.0,
        5.0,
        180.0,
        5.0,
        label="hue within",
        unit="°",
        help="Where masks are made by threshold: how far a hue may lie from the subject's; 180 = any.",
    )
    mask_saturation: float = next_frame_knob(
        0.0,
        0.0,
        1.0,
        0.05,
        label="least saturation",
        help="Where masks are made by threshold: paler pixels are not the subject; 0 = grey ones count too.",
    )
    mask_opening: int = next_frame_knob(
        3,
        0,
        31,
        1,
        label="remove specks",
        unit="px",
        help="Opening: specks and threads thinner than this vanish; 0 = off.",
    )
    mask_closing: int = next_frame_knob(
        5,
        0,
        61,
        1,
        label="close gaps",
        unit="px",
        help="Closing: gaps narrower than this are filled; 0 = off.",
    )
    mask_fill_holes: int = next_frame_knob(
        150,
        0,
        100000,
        50,
        label="fill holes up to",
        unit="px²",
        help="Holes smaller than this area are filled; 0 = off.",
    )
    mask_min_component: int = next_frame_knob(
        150,
        0,
        100000,
        50,
        label="smallest piece",
        unit="px²",
        help="Connected pieces smaller than this area are dropped; 0 = off.",
    )
    mask_keep_components: int = next_frame_knob(
        0, 0, 20, 1, label="pieces kept", help="Only this many largest pieces are kept; 0 = all."
    )
    mask_clean_given: bool = next_frame_knob(
        False, label="clean given masks", help="Apply the clean-up also to masks that came with the footage."
    )
    edge_threshold: float = next_frame_knob(
        6.0,
        0.5,
        60.0,
        0.5,
        label="edge threshold",
        unit="grey levels/px",
        help="Weaker gradients are no edges.",
    )
    edge_smoothing: float = next_frame_knob(
        2.0,
        0.5,
        20.0,
        0.25,
        label="edge smoothing",
        unit="px",
        help="Standard deviation of the Gaussian: the distance at which an edge has effect.",
    )
    edge_near_mask: int = next_frame_knob(
        0,
        0,
        100,
        1,
        label="edges near the mask",
        unit="px",
        help="Drop edges further than this from the foreground; 0 = keep all, as in the paper.",
    )
    hull_evidence: str = next_frame_knob(
        "auto",
        label="hull from",
        choices=HULL_EVIDENCE,
        help="Evidence for the visual hull: pixels tested one by one against the background's colours, as in the paper"
        " (no mask is made), or masks; auto: pixels where every camera has a plate or an empty clip and no masks.",
    )
    hull_noise: float = next_frame_knob(
        LEAST_NOISE,
        0.5,
        40.0,
        0.5,
        label="hull's camera noise",
        unit="grey levels",
        help="Smallest standard deviation of a background pixel where pixels carve the hull; raise it where the light"
        " flickers.",
    )
