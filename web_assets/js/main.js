// The page starts here: parts are wired to the state, the state to the server.

import { fetchJson, post, runPath } from "./api.js";
import { cameraTools, startCameras } from "./cameras.js";
import { startCurtain } from "./curtain.js";
import { startHeader } from "./header.js";
import { startKeys } from "./keys.js";
import { onEvent, startLive } from "./live.js";
import { startLog } from "./log.js";
import { complain } from "./messages.js";
import { startPlayback } from "./playback.js";
import { openSession, refreshSessions, startRail } from "./rail.js";
import { get, set, watch } from "./state.js";
import { startSurvival } from "./survival.js";
import { startTheme } from "./theme.js";
import { startTimeline } from "./timeline.js";
import { startVariance, varianceCsv } from "./variance.js";
import { startWeights } from "./weights.js";

const byId = (id) => document.getElementById(id);

function download(name, text) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(new Blob([text], { type: "text/csv" })), download: name });
  link.click();
  URL.revokeObjectURL(link.href);
}

function startTabs() {
  const tabs = [...document.querySelectorAll("[role=tab]")];
  const choose = (tab) => {
    for (const one of tabs) {
      one.setAttribute("aria-selected", String(one === tab));
      one.tabIndex = one === tab ? 0 : -1;
      byId(`panel-${one.dataset.panel}`).hidden = one !== tab;
    }
    localStorage.setItem("panel", tab.dataset.panel);
    byId("tab-tools").replaceChildren(...toolsOf(tab.dataset.panel));
    document.dispatchEvent(new Event("panel"));
  };
  for (const tab of tabs) {
    tab.onclick = () => choose(tab);
    tab.onkeydown = (event) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!by) return;
      event.stopPropagation();
      const next = tabs[(tabs.indexOf(tab) + by + tabs.length) % tabs.length];
      next.focus();
      choose(next);
    };
  }
  choose(tabs.find((tab) => tab.dataset.panel === localStorage.getItem("panel")) ?? tabs[0]);
  byId("panels-fold").onclick = () => {
    const folded = document.body.classList.toggle("panels-folded");
    byId("panels-fold").textContent = folded ? "▴" : "▾";
    byId("panels-fold").setAttribute("aria-expanded", String(!folded));
  };
}

function toolsOf(panel) {
  if (panel === "cameras") return cameraTools();
  if (panel !== "variance") return [];
  const csv = Object.assign(document.createElement("button"), { className: "quiet small", textContent: "CSV", title: "This frame's variances as CSV" });
  csv.onclick = () => {
    const detail = get("detail");
    if (detail) download(`${get("session")}-${get("run")}-frame${detail.frame}-variance.csv`, varianceCsv(detail, get("whatIf") ?? detail.layers));
  };
  return [csv];
}

async function loadSummary() {
  const [session, run] = [get("session"), get("run")];
  if (!run) return;
  try {
    const summary = await fetchJson(`${runPath(session, run)}/frames`);
    if (session !== get("session") || run !== get("run")) return;
    const last = summary.frames.at(-1)?.frame ?? null;
    set({ summary, frame: get("follow") || get("frame") === null ? last : get("frame") });
  } catch (error) { complain(error); }
}

/** Asking again for what may have changed, at most once per interval, the last wish always served. */
function paced(work, milliseconds) {
  let timer = null;
  return () => { timer ??= setTimeout(() => { timer = null; work(); }, milliseconds); };
}

let asked = null;

async function loadDetail() {
  const [session, run, frame] = [get("session"), get("run"), get("frame")];
  if (!run || frame === null) return set({ detail: null });
  asked?.abort();
  asked = new AbortController();
  try {
    const detail = await fetchJson(`${runPath(session, run)}/frames/${frame}`, { signal: asked.signal });
    if (frame === get("frame") && run === get("run")) set({ detail });
  } catch (error) { if (error.name !== "AbortError" && error.status !== 404) complain(error); }
}

function showInScene() {
  if (!get("session")) return;
  post("/api/scene/show", { session: get("session"), run: get("run"), frame: get("frame"), layer: get("layer") }).catch(complain);
}

function startData() {
  const summaryLater = paced(loadSummary, 400);
  const detailLater = paced(loadDetail, 80);
  const sceneLater = paced(showInScene, 33);
  watch(["run"], loadSummary);
  watch(["run", "frame"], detailLater);
  watch(["session", "run", "frame", "layer"], sceneLater);
  onEvent("frame", (event, here) => { if (here && !event.reannealed) summaryLater(); });
  onEvent("layer", (event, here) => { if (here) takeLayer(event); });
  onEvent("state", (event, here) => {
    if (here && event.state !== "tracking") { summaryLater(); refreshLater(); }
    if (here && event.state === "reannealing") set({ whatIf: null });
  });
  onEvent("sessions", () => refreshLater());
  onEvent("scene", (event) => takeScene(event));
  const refreshLater = paced(refreshSessions, 600);
}

/** The scene's own controls (timeline, layer) moved: follow them. */
function takeScene(event) {
  if (event.session !== get("session") || event.run !== get("run")) return;
  const changes = {};
  if (event.frame !== undefined && event.frame !== null && get("summary")?.frames.some((entry) => entry.frame === event.frame)) changes.frame = event.frame;
  if (event.layer !== undefined) changes.layer = event.layer;
  set(changes);
}

/** Live layers: those of a what-if collect beside the stored answer; those of a frame in progress are shown at once. */
function takeLayer(event) {
  const detail = get("detail");
  if (event.reannealed) {
    const before = event.layer === 0 ? [] : (get("whatIf") ?? []).filter((layer) => layer.layer < event.layer);
    return set({ whatIf: [...before, event] });
  }
  if (get("work")?.state === "tracking" || !get("follow") || !detail) return;
  const before = detail.frame === event.frame ? detail.layers.filter((layer) => layer.layer < event.layer) : [];
  set({ detail: { ...detail, frame: event.frame, layers: [...before, event] } });
}

async function start() {
  startTheme();
  startHeader();
  startRail();
  startTimeline();
  startPlayback();
  startVariance();
  startSurvival();
  startWeights();
  startCameras();
  startLog();
  startTabs();
  startKeys();
  startCurtain();
  startData();
  startLive();
  byId("scene").src = "/scene/";
  await refreshSessions();
  const wish = new URLSearchParams(location.search);
  const sessions = get("sessions") ?? [];
  const first = sessions.find((one) => one.name === wish.get("session")) ?? sessions.find((one) => one.runs.length) ?? sessions[0];
  if (first) openSession(first.name, wish.get("run") ?? undefined);
}

start();
