"""Run with NUMBA_ENABLE_CUDASIM=1 and NUMBA_DISABLE_JIT=1: prepared runs tracked side by side on a device, in Numba's
simulator of one, and the same runs tracked alone. Poses are weighed by NumPy. Writes how many kernels were launched to
the file named, beside which the session lies.
"""

import pickle
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

LONE, PLACE = "alone", "toy"
OWN: tuple[dict[str, object], ...] = (
    {"survival": 0.3, "start_repeats": 2},
    {"survival": 0.6, "diffusion_covariance": "full", "estimate": "mode"},
    {"adaptive_diffusion": False, "diffusion_scale": 2.0, "dynamics": "constant_velocity"},
    {"crossover": 0.0, "survival_per_layer": "0.8, 0.4"},
)
"""Knobs in which the runs differ, beside their seeds."""
SHARED: dict[str, object] = {"layers": 3, "particles": 10, "start_repeats": 1, "refine_frames": False}
FRAMES = 3
HALVED = 2
"""The run that is taken up again inside its second frame: this many of its layers are done beforehand, and a frame."""


def centre_of(frame: int) -> np.ndarray:
    return np.array([0.3, -0.2, 0.1, 0.2]) + 0.1 * frame


class Weighed:
    """A frame weighed by NumPy, here and there."""

    def __init__(self, frame: int, device: Any) -> None:  # noqa: ANN401
        self.frame, self.device = frame, device

    def on_device(self) -> Any:  # noqa: ANN401
        seen = SimpleNamespace(observed=[0], memory=self.frame, scale=1.0)
        return SimpleNamespace(device=self.device, frame=seen, factors=(1.0,), number=self.frame)

    def give_up_device(self, error: Exception) -> None:
        raise error

    def log_likelihood(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
        return -20.0 * ((poses - centre_of(self.frame)) ** 2 * [1.0, 2.0, 3.0, 4.0]).sum(axis=1)

    fitness = log_likelihood

    def feasible(self, poses: np.ndarray, limbs_apart: bool = False) -> np.ndarray:
        return np.ones(len(poses), dtype=bool)


class Device:
    """Weighs what lies on it. launches : kernels and weighings so far."""

    launches = 0

    def lend_arrays(self, borrower: object) -> dict[Any, Any]:
        return {}

    def edges_of(self, limbs: Any) -> None:  # noqa: ANN401
        return None

    def bring(self, poses: np.ndarray, there: Any) -> None:  # noqa: ANN401
        there.copy_to_device(np.ascontiguousarray(poses.T.astype(np.float32)))

    def weigh(self, poses, problem, edges, every, found, stream, memory) -> None:
        Device.launches += 1
        values = Weighed(problem.number, self).log_likelihood(poses.copy_to_host().T.astype(np.float64))
        found.copy_to_device(np.stack([np.zeros(len(values)), values]))


class Frames:
    """The frames of all runs that share it."""

    def __init__(self) -> None:
        device = Device()
        self.frames = [Weighed(frame, device) for frame in range(FRAMES)]

    def problem(self, frame: int, settings: Any) -> Weighed:  # noqa: ANN401
        return self.frames[frame]


def track(runs: Sequence[Any]) -> None:
    """Track runs to their ends, a frame of all at a time."""
    frames = Frames()
    with ExitStack() as stack:
        tracked = [TrackingRun(run, frames) for run in runs]
        for one in tracked:
            stack.callback(one.close)
        while going := [one for one in tracked if not one.finished]:
            least = min(one.next_frame for one in going)
            step_together([one for one in going if one.next_frame == least])


def begin(run: Any, layers: int) -> None:  # noqa: ANN401
    """Do so many of a run's layers."""
    tracking = TrackingRun(run, Frames())
    for _ in range(layers):
        tracking.step_layer()
    tracking.close()


def launched(kernel: Any) -> Any:  # noqa: ANN401
    """Kernels that are counted when they are launched."""

    def counted(name: str) -> Any:  # noqa: ANN401
        Device.launches += 1
        return kernel(name)

    return counted


if __name__ == "__main__":
    from threads_in_turn import take_threads_in_turn

    from studio.runs.tracking_run import TrackingRun, step_together
    from studio.search.trackers import device_runs, device_search, device_search_kernels
    from studio.sessions.session import Session

    take_threads_in_turn()
    device_search_kernels.SUMMING = device_search.SUMMING = 2
    device_runs.THREADS = device_search.THREADS = 8
    device_runs.record_launches = lambda launches, stream: None
    device_search.kernel = device_runs.kernel = launched(device_runs.kernel)
    place = Path(sys.argv[1])
    session = Session(place.parent / PLACE)
    counts = {}
    for name, prefix in (("together", "beside"), ("alone", LONE)):
        own = [session.run(f"{prefix}-{number}") for number in range(len(OWN))]
        if prefix != LONE:
            begin(own[HALVED], 3 + HALVED)
        Device.launches, counts[name] = 0, []
        for group in [own] if prefix != LONE else [[one] for one in own]:
            before = Device.launches
            track(group)
            counts[name].append(Device.launches - before)
    place.write_bytes(pickle.dumps(counts))
