"""Playing stored frames: arithmetic without a clock."""

from studio.scene.playback import Playback, nearest, stepped

FRAMES = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]


def test_real_time_shows_one_frame_a_period() -> None:
    playback, frame = Playback(playing=True), 0
    for _ in range(12):
        playback, frame = playback.advanced(0.5 / 60.0, 60.0, frame, FRAMES)
    assert frame == 6


def test_speed_scales_it_and_nothing_is_lost_between_ticks() -> None:
    playback, frame = Playback(playing=True, speed=0.25), 0
    for _ in range(33):
        playback, frame = playback.advanced(1.0 / 30.0, 30.0, frame, FRAMES)
    assert frame == 8


def test_the_end_starts_over_or_stops() -> None:
    looped, frame = Playback(playing=True, loop=True).advanced(2.0, 1.0, 9, FRAMES)
    assert (looped.playing, frame) == (True, 1)
    held, frame = Playback(playing=True, loop=False).advanced(2.0, 1.0, 9, FRAMES)
    assert (held.playing, frame) == (False, 9)


def test_gaps_are_stepped_over() -> None:
    assert stepped(2, [0, 2, 5], 1) == 5
    assert stepped(5, [0, 2, 5], 1) == 5
    assert stepped(0, [0, 2, 5], -3) == 0
    assert stepped(None, [], 1) is None
    assert nearest(4, [0, 2, 5]) == 5
    assert nearest(4, []) is None


def test_nothing_stored_shows_nothing() -> None:
    assert Playback(playing=True).advanced(1.0, 60.0, None, []) == (Playback(playing=True), None)
