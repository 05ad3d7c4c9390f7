"""The knobs of detecting a lost tracker and of finding the body again, the same for every tracker."""

from dataclasses import dataclass

from studio.foundations.knobs import next_frame_knob

OFF, SPREAD, INITIALISE = "off", "spread", "initialise"


@dataclass(frozen=True, slots=True)
class RecoverySettings:
    """Loss detection and recovery (Caillette, Galata & Howard 2007, section 6.3, and a search of our own)."""

    title = "Recovery"

    # On footage with a second of black pictures, and with a person who leaves and comes back elsewhere, the search
    # found the body in every run; particles spread over joints and clusters only where many of them are weighed.
    recovery: str = next_frame_knob(
        INITIALISE,
        choices=(INITIALISE, SPREAD, OFF),
        help="When lost: search as for a start pose, or spread the particles over the motion clusters (without a "
        "behaviour model over the joints' ranges) at the hull. Off: losses are not detected.",
    )
    lost_after: int = next_frame_knob(
        3, 1, 60, 1, label="lost after", unit="frames",
        help="Frames in a row that must look lost before the run counts as lost.",
    )  # fmt: skip
    recovery_interval: int = next_frame_knob(
        10, 1, 600, 1, label="search again after", unit="frames",
        help="Frames between two searches while the body is not found.",
    )  # fmt: skip
