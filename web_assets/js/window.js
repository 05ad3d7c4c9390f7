// This window's name: its scene in the studio goes by it. A window keeps it over reloads and from
// page to page; a copy of the window gets another one, because the name is in the store only while
// the window is between two pages.

const KEY = "window";

/** Random letters and digits. */
export const windowName =
  sessionStorage.getItem(KEY) ??
  [...crypto.getRandomValues(new Uint8Array(12))]
    .map((byte) => byte.toString(16).padStart(2, "0"))
    .join("");

const take = () => sessionStorage.removeItem(KEY);

take();
addEventListener("pagehide", () => sessionStorage.setItem(KEY, windowName));
addEventListener("pageshow", take);

/** Where this window's own scene is served. */
export const scenePath = `/scene/${windowName}/`;

/** Where its second scene is served, which shows trials. */
export const triedScenePath = `/scene/${windowName}-tried/`;

/** A socket to the studio's events, those of this window's scene among them. */
export const eventSocket = () =>
  new WebSocket(
    `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/api/events?window=${windowName}`,
  );
