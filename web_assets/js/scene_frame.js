// The scene's frame: viser's own page, in the studio's type and colours, with the page's keys working in it.

import { takeKey } from "./keys.js";
import { onTheme, token } from "./theme.js";

const frame = document.getElementById("scene");
const FONT = "/assets/vendor/inter.woff2";
// viser turns the view with these itself.
const SCENE_KEYS = ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"];
const style = document.createElement("style");

function look() {
  return `
    body, body * { font-family: "Inter", system-ui, sans-serif !important; letter-spacing: 0 !important; font-variant-numeric: tabular-nums; }
    * { scrollbar-width: thin; scrollbar-color: ${token("line-strong")} transparent; }
    :root, :root[data-mantine-color-scheme] {
      --mantine-color-body: ${token("surface")};
      --mantine-color-text: ${token("text")};
      --mantine-color-dimmed: ${token("text-quiet")};
      --mantine-color-default: ${token("surface-raised")};
      --mantine-color-default-border: ${token("line-strong")};
    }`;
}

async function dress() {
  const page = frame.contentDocument;
  if (!page?.body || frame.src === "about:blank") return;
  style.textContent = look();
  page.head.append(style);
  if (![...page.fonts].some((face) => face.family === "Inter")) {
    const face = new frame.contentWindow.FontFace("Inter", await (await fetch(FONT)).arrayBuffer(), { weight: "100 900" });
    page.fonts.add(await face.load());
  }
}

/** Load the scene, dressed as the page. */
export function startSceneFrame() {
  frame.addEventListener("load", () => {
    dress();
    frame.contentWindow.addEventListener("keydown", (event) => { if (!SCENE_KEYS.includes(event.key)) takeKey(event); });
  });
  onTheme(() => { style.textContent = look(); });
  frame.src = "/scene/";
}
