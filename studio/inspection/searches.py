"""The searches of a frame: one, or several where a run starts and the body is searched over and over."""

from studio.errors import StudioError
from studio.inspection.reading import InspectedFrame
from studio.trackers.catalogue import TRACKERS


def layers_of_a_search(frame: InspectedFrame) -> int:
    """Layers of one search of the frame; all of its layers where its tracker is not installed."""
    layers, run = len(frame.layers), frame.of.run.record
    try:
        counted = TRACKERS[run.tracker].layer_count(frame.settings.tracker)
    except (StudioError, KeyError):
        return layers
    # A frame is never searched one and a half times over: such a record is of another version's layers.
    return counted if frame.result is None or layers % counted == 0 else layers


def searches_of(frame: InspectedFrame) -> int:
    """How many searches the frame has, those to come counted."""
    begun = -(-len(frame.layers) // layers_of_a_search(frame))
    if frame.result is not None or frame.number != frame.of.run.record.first:
        return begun
    return max(begun, getattr(frame.settings.tracker, "start_repeats", 1))
