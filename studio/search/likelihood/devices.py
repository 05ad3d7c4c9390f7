"""What weighs the poses of a likelihood: the processor, or a graphics card where the knob `device` asks for one.

With `auto` a card that is not there, or that fails in compiling or launching a kernel, leaves the work to the
processor, and a frame's notes say why, once.

Cards weigh by edges and region, with or without the silhouette's areas (`device_weighing`), and by the benchmark's
score (`device_score`). The other likelihoods are the processor's:

- `blobs`: a pose costs its joints and a few products a blob, no picture is read. What takes time is carving the hull
  and fitting blobs to it, once a search, from poses that the search expects; a card would wait for that.
- `edge-silhouette`: samples lie along what can be seen of the body's outline, whose edges are cut by one another first.
- `template`: for one experiment with one camera, whose areas are those of the third term.
"""

import importlib
from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal

from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError, StudioError
from studio.foundations.knobs import next_frame_knob
from studio.search.likelihood.problem import BaseFrameLikelihood, Preparation

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from studio.search.likelihood.device_weighing import FrameOnDevice, ProblemOnDevice, WeighingDevice

CPU, AUTO, GPU = "cpu", "auto", "gpu"
DEVICES = CPU, AUTO, GPU
Device = Literal["cpu", "auto", "gpu"]
DEVICE_KNOB = "device"
DEVICE_MODULE = "studio.search.likelihood.device_weighing"
NO_DEVICE_HINT = (
    "It needs an NVIDIA card, its driver and the extra `gpu` (pip install 'capture-studio[gpu]'), which `studio doctor`"
    " tries; set device to cpu, or to auto, which takes a card only where one works."
)


def device_knob() -> Any:  # noqa: ANN401 - a dataclass's field
    """The knob of all likelihoods that a card can weigh by."""
    return next_frame_knob(
        CPU,
        choices=DEVICES,
        help="What weighs poses: the processor, or an NVIDIA card with CUDA (extra `gpu`), which agrees but for a"
        " sample in thousands; auto takes a card where there is one.",
    )


class DevicePreparation(Preparation):
    """A likelihood by which a card may weigh. device : what weighs poses in place of the processor. unsaid : why the
    processor weighs them where a card was to be taken if there is one; the next frame's notes say it.
    """

    device: "WeighingDevice | None" = None
    unsaid: tuple[str, ...] = ()

    def choose_device(self, make: "Callable[[ModuleType], WeighingDevice]") -> None:
        """Take what the settings ask for. make : a card's part, of the module DEVICE_MODULE.

        Raises StudioError where a card was asked for and is not there or cannot be used.
        """
        try:
            self.device = device_for(self.settings.device, make)
        except StudioError as error:
            self.unsaid = without_device(self.settings.device, error)


class DeviceFrameLikelihood(BaseFrameLikelihood):
    """A frame whose poses a card may weigh."""

    def __init__(
        self, likelihood: DevicePreparation, bring: "Callable[[WeighingDevice], FrameOnDevice]"
    ) -> None:
        """bring : what the frame needs to a device."""
        self.prepared, self.priors = likelihood, likelihood.priors
        self._notes, likelihood.unsaid = likelihood.unsaid, ()
        self._on_device: FrameOnDevice | None = None
        try:
            self._on_device = None if likelihood.device is None else bring(likelihood.device)
        except Exception as error:
            self.give_up_device(error)

    @property
    def notes(self) -> tuple[str, ...]:
        """Why the processor weighs poses, in the first frame after a card was not there or failed."""
        return self._notes

    def device_weights(
        self,
        poses: Array,
        factors: tuple[float, float, float],
        limbs: "NDArray[np.int64] | None" = None,
    ) -> tuple[Array, Array] | None:
        """(N,) fitness and (N,) log-weights of poses (N, D), found on the device; None where the processor is to find
        them. factors : of the likelihood's terms. limbs : those whose edges count, by number; None: all.

        Raises BodyError for poses that are no finite (N, D), StudioError where a card that was asked for fails.
        """
        return self.from_device("weights", poses, limbs, factors)

    def problem_there(
        self, factors: tuple[float, float, float], trunk: "NDArray[np.int64] | None", ranked: int
    ) -> "ProblemOnDevice | None":
        """This frame's likelihood there, with these fields, for a search that keeps its particles there; None where
        there is no device.
        """
        device, frame = self.prepared.device, self._on_device
        if device is None or frame is None:
            return None
        return importlib.import_module(DEVICE_MODULE).ProblemOnDevice(device, frame, factors, trunk, ranked)

    def from_device(self, method: str, poses: Array, *further: Any) -> Any:  # noqa: ANN401 - the method's own
        """What a method of the device gives of poses (N, D); None where the processor is to find it."""
        device, frame = self.prepared.device, self._on_device
        if device is None or frame is None:
            return None
        shaped = self.prepared.projector.shaped(poses)
        try:
            # Kernels are compiled by a process's first launch.
            return getattr(device, method)(shaped, frame, *further)
        except BodyError:
            self.prepared.projector.checked(poses)
            raise
        except Exception as error:
            self.give_up_device(error)
            return None

    def give_up_device(self, error: Exception) -> None:
        """The processor from now on, in this frame and the next. Raises StudioError where the card was asked for."""
        refused = StudioError(f"The card failed: {in_a_line(error)}.", NO_DEVICE_HINT)
        note = without_device(self.prepared.settings.device, refused)
        # Another frame's failure has said it already.
        self._notes += note if self.prepared.device is not None else ()
        self.prepared.device = self._on_device = None


def device_for(chosen: str, make: "Callable[[ModuleType], WeighingDevice]") -> "WeighingDevice | None":
    """What the setting `device` asks for; None is the processor. make : a card's part, of the module DEVICE_MODULE.

    Raises StudioError where there is no device or it cannot be used.
    """
    if chosen == CPU:
        return None
    try:
        module = importlib.import_module(DEVICE_MODULE)
        why = module.missing()
        if not why:
            return make(module)
    except StudioError:
        raise
    except Exception as error:
        raise StudioError(f"A GPU cannot be used: {in_a_line(error)}.", NO_DEVICE_HINT) from error
    raise StudioError(f"A GPU cannot be used: {why}.", NO_DEVICE_HINT)


def is_processor(chosen: str) -> bool:
    """Whether the setting `device` leaves the work to the processor on this machine, as `auto` does without a card."""
    if chosen != AUTO:
        return chosen == CPU
    try:
        return bool(importlib.import_module(DEVICE_MODULE).missing())
    except Exception:
        return True


def without_device(chosen: str, error: StudioError) -> tuple[str, ...]:
    """A note that says why the processor evaluates. Raises the error where the settings ask for the card."""
    if chosen == GPU:
        raise error
    return (f"The processor weighs the poses. {error.message}",)


def in_a_line(error: Exception) -> str:
    """An error of a library in one line, its kind where it says nothing else."""
    return " ".join(str(error).split()).rstrip(" :.") or type(error).__name__
