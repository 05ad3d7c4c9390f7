// The scene's frame: viser's own page, in the studio's type and colours, with the page's keys working in it.

import { takeKey } from "./keys.js";
import { onTheme, theme, token } from "./theme.js";

const frame = document.getElementById("scene");
const FONT = "/assets/vendor/inter.woff2";
// viser turns the view with these itself.
const SCENE_KEYS = ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"];
const style = document.createElement("style");

function look() {
  const dark = theme() === "dark" ? `
      --mantine-color-dark-4: ${token("line-strong")} !important;
      --mantine-color-dark-5: ${token("line")} !important;
      --mantine-color-dark-6: ${token("surface-raised")} !important;
      --mantine-color-dark-7: ${token("surface")} !important;` : "";
  return `
    body, body * { font-family: "Inter", system-ui, sans-serif !important; letter-spacing: 0 !important; font-variant-numeric: tabular-nums; }
    label, label * { font-size: 11.5px !important; letter-spacing: -.03em !important; }
    [role="tab"] { padding-inline: 8px !important; font-size: 12.5px !important; }
    * { scrollbar-width: thin; scrollbar-color: ${token("line-strong")} transparent; }
    :root, :root[data-mantine-color-scheme] {
      --mantine-color-body: ${token("surface")} !important;
      --mantine-color-text: ${token("text")} !important;
      --mantine-color-dimmed: ${token("text-quiet")} !important;
      --mantine-color-default: ${token("surface-raised")} !important;
      --mantine-color-default-border: ${token("line-strong")} !important;${dark}
    }`;
}

async function dress() {
  const page = frame.contentDocument;
  style.textContent = look();
  page.head.append(style);
  if (![...page.fonts].some((face) => face.family === "Inter")) {
    const face = new frame.contentWindow.FontFace("Inter", await (await fetch(FONT)).arrayBuffer(), { weight: "100 900" });
    page.fonts.add(await face.load());
  }
}

/** Keys for a slider or a field must not turn the view as well, which listens further out. */
function keepToControls(event) {
  if (event.target.closest?.("[role=slider], [role=tab], input, textarea, select")) event.stopPropagation();
}

/** Load the scene, dressed as the page. */
export function startSceneFrame() {
  frame.addEventListener("load", () => {
    if (frame.src.endsWith("about:blank")) return;
    dress();
    for (const kind of ["keydown", "keyup"]) frame.contentDocument.body.addEventListener(kind, keepToControls);
    frame.contentWindow.addEventListener("keydown", (event) => { if (!SCENE_KEYS.includes(event.key)) takeKey(event); });
  });
  onTheme(() => { style.textContent = look(); });
  frame.src = "/scene/";
}
