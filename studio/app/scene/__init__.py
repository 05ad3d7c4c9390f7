"""The viser scene of a window: a pure model, views that draw it, and one thread that owns both.

Each window of the page names itself in every call; `WindowScenes` keeps one `SceneServer` a name, and a sweep closes
it once its window has gone for a minute. A scene is three things: a `Model` (what is selected and shown; one
immutable value, changed by plain functions `change(model, *values)`), views that draw it into viser, and the
`SceneController`. viser's callbacks, the page and other threads only post changes; they happen one after another. The
model owns both playbacks, of frames and of a frame's layers; while only the phase of a layer moves, nothing but
places is drawn (`SearchView.travel`). While a trial is shown the window has a second scene (`twin.py`) that follows
the first. Where viewers stand is the affair of `Viewers`, where they should stand of pure functions (`viewpoint.py`).
Pictures and films are drawn by the window's own browser (`scene_pictures.py`).
"""

METRES_PER_MM = 0.001
"""The scene is drawn in metres; everything else in the studio is in mm."""
