// The header: the run, the state of the tracking process, progress and time left; and the buttons
// that operate it.

import { byId } from "../elements.js";
import { follow, html, mount, useEffect } from "./component.js";
import { Select } from "./parts.js";
import {
  command,
  loadSpeeds,
  offers,
  reanneal,
  setSpeed,
  speeds,
  standing,
  step,
  toggleTracking,
} from "./tracking.js";

const SPEED_TITLE =
  "Search speed: how fast layers follow each other while tracking, to watch the search " +
  "(no result changes; Layer, Frame and Re-anneal are not slowed)";

function Crumbs() {
  const [session, run, summary] = [follow("session"), follow("run"), follow("summary")];
  useEffect(() => {
    if (session) document.title = `${session} – Capture studio`;
  }, [session]);
  return html`<span class="crumbs" id="crumbs" aria-live="polite">
    ${session && html`<b>${session}</b>${run && ` / ${run}`}${summary && ` · ${summary.describe ?? ""}`}`}
  </span>`;
}

/** What is tracked: its own component, because it changes many times a second. */
function State() {
  const work = follow("work");
  const { name, words, title, share } = standing(
    work,
    follow("session"),
    follow("run"),
    follow("connected"),
    follow("summary"),
  );
  const isCompiling = work?.state === "compiling";
  return html`
    <span class="state" id="state" role="status" data-state=${name} title=${title}>
      <i class="dot"></i><span id="state-text">${words}</span>
    </span>
    <div
      class=${`progress ${isCompiling ? "unknown" : ""}`}
      id="run-progress"
      hidden=${share === null}
    >
      <i style=${{ width: isCompiling ? "" : `${100 * (share ?? 0)}%` }}></i>
    </div>
  `;
}

/** How slowly the search goes: full speed and slow motion, whatever is tracked. */
function Speed() {
  const inUse = follow("work")?.seconds_a_layer ?? 0;
  const connected = follow("connected");
  const isOffered = speeds.value.some((one) => one.seconds_a_layer === inUse);
  useEffect(() => {
    if (connected && !isOffered) loadSpeeds();
  }, [connected, isOffered]);
  return html`<${Select}
    id="search-speed"
    aria-label="Search speed"
    title=${SPEED_TITLE}
    disabled=${!connected || !isOffered}
    options=${speeds.value.map((one) => [String(one.seconds_a_layer), one.label])}
    value=${String(inUse)}
    take=${(seconds) => setSpeed(Number(seconds))}
  />`;
}

function Tracking() {
  const { word, isFirst, ...can } = offers(
    follow("work"),
    follow("session"),
    follow("run"),
    follow("connected"),
    follow("summary"),
    follow("frame"),
  );
  return html`
    <button
      id="track-toggle"
      class=${isFirst ? "primary" : ""}
      disabled=${!can.toggle}
      title="Continue tracking, or pause after the layer in progress"
      onClick=${toggleTracking}
    >
      ${word}
    </button>
    <button
      id="step-layer"
      disabled=${!can.step}
      title="One layer, then stop inside the frame"
      onClick=${() => step("step-layer")}
    >
      Layer
    </button>
    <button
      id="step-frame"
      disabled=${!can.step}
      title="Finish the frame, then pause"
      onClick=${() => step("step-frame")}
    >
      Frame
    </button>
    <button
      id="reanneal"
      disabled=${!can.reanneal}
      title="Anneal this frame again with the current knobs (r)"
      onClick=${reanneal}
    >
      Re-anneal
    </button>
    <button
      id="cancel"
      class="quiet"
      disabled=${!can.cancel}
      title="End this run; tracked frames stay"
      onClick=${() => command("cancel")}
    >
      Cancel
    </button>
  `;
}

const Header = () => html`
  <${Crumbs} />
  <span class="spring"></span>
  <${State} />
  <div class="group" role="group" aria-label="Tracking"><${Speed} /><${Tracking} /></div>
`;

/** Show the header. */
export const startHeader = () => mount(byId("header-parts"), html`<${Header} />`);
