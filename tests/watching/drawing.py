"""When a browser drew what it was sent: the scene's uploads to the graphics, from inside its page."""

from dataclasses import dataclass

from playwright.sync_api import Browser, BrowserContext, Frame
from studio_page import StudioPage

HOOKS = """(() => {
  const watch = { keys: [], uploads: [], pictures: [] };
  window.__watch = watch;
  const now = () => performance.timeOrigin + performance.now();
  addEventListener("keydown", (event) => watch.keys.push(performance.timeOrigin + event.timeStamp), true);
  const proto = window.WebGL2RenderingContext?.prototype;
  if (!proto) return;
  let waiting = [], isDrawing = false;
  const clear = proto.clear;
  proto.clear = function (...given) {
    // Shadows are drawn in the same task: it ends with one picture.
    if (!isDrawing) queueMicrotask(() => { isDrawing = false; watch.pictures.push(now()); });
    isDrawing = true;
    return clear.apply(this, given);
  };
  for (const name of ["bufferData", "bufferSubData"]) {
    const upload = proto[name];
    proto[name] = function (...given) {
      const done = upload.apply(this, given);
      const data = given.find((one) => ArrayBuffer.isView(one));
      if (!data) return done;
      // The picture is drawn in the same task; reading a pixel of it waits until the graphics are done with it.
      if (!waiting.length) queueMicrotask(() => {
        this.readPixels(0, 0, 1, 1, this.RGBA, this.UNSIGNED_BYTE, new Uint8Array(4));
        for (const entry of waiting) watch.uploads.push({ ...entry, drawn: now() });
        waiting = [];
      });
      waiting.push({ bytes: data.byteLength, at: now() });
      return done;
    };
  }
})()"""
READ = "() => window.__watch"
QUIET_MILLISECONDS = 700
"""What was sent is drawn once nothing more was for so long."""
CLEAR = "() => { for (const kind of Object.values(window.__watch)) kind.length = 0; }"


@dataclass(frozen=True, slots=True)
class Upload:
    """size : bytes. drawn : when the picture with it was finished, ms since 1970 by the browser's clock."""

    size: int
    drawn: float


class _WatchedBrowser:
    def __init__(self, browser: Browser) -> None:
        self._browser = browser

    def new_context(self, **options: object) -> BrowserContext:
        context = self._browser.new_context(**options)  # pyright: ignore[reportArgumentType]
        context.add_init_script(HOOKS)
        return context


def watched(browser: Browser) -> Browser:
    """A browser whose windows note what they draw."""
    return _WatchedBrowser(browser)  # pyright: ignore[reportReturnType]


class Drawing:
    """What a window's scene uploads and draws; the window is one of a `watched` browser."""

    def __init__(self, window: StudioPage) -> None:
        self._window = window

    def clear(self) -> None:
        """Forget what was."""
        for frame in self._frames():
            frame.evaluate(CLEAR)

    def keys(self) -> list[float]:
        """When keys were pressed in the scene, ms since 1970."""
        return self._frames()[0].evaluate(READ)["keys"]

    def pictures(self) -> list[float]:
        """When pictures were drawn, ms since 1970."""
        return self._frames()[0].evaluate(READ)["pictures"]

    def uploads(self, sizes: set[int]) -> list[Upload]:
        """Those of some sizes, in order; a trial is drawn in the window's second scene once that is there."""
        found = [one for frame in self._frames() for one in frame.evaluate(READ)["uploads"]]
        made = [Upload(one["bytes"], one["drawn"]) for one in found if one["bytes"] in sizes]
        return sorted(made, key=lambda upload: upload.drawn)

    def settled(self, sizes: set[int]) -> list[float]:
        """When uploads of some sizes were drawn, ms since 1970, once there are some and no more come."""
        before = -1
        while True:
            self._window.page.wait_for_timeout(QUIET_MILLISECONDS)
            found = [one.drawn for one in self.uploads(sizes)]
            if found and len(found) == before:
                return found
            before = len(found)

    def _frames(self) -> list[Frame]:
        """The window's own scene, and its second one where there is one."""
        scenes = [frame for frame in self._window.page.frames if "/scene/" in frame.url]
        return sorted(scenes, key=lambda frame: "-tried" in frame.url)


def cloud_sizes(points: int) -> set[int]:
    """Bytes of the places of so many points, as half or single precision numbers."""
    return {points * 3 * width for width in (2, 4)}
