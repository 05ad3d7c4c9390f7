// The rail: sessions and their runs, and what is in the trash.

import { readOnly, sessionPath } from "../api.js";
import { figure } from "../chart_looks.js";
import { acceptDrops } from "../dropping.js";
import { byId, partWords } from "../elements.js";
import { importForm } from "./importing.js";
import { newRunForm } from "./new_run.js";
import { lacks, openSession, setupPath, studioPath } from "../sessions.js";
import { get, watch } from "../state.js";
import { computed, follow, html, mount, signal, useState } from "./component.js";
import {
  comparisonsPath,
  loadTrash,
  restorable,
  runMenu,
  sessionMenu,
  trashMenu,
} from "./rail_menus.js";

/** Runs of a sweep, as SWEEP-pPOINT-sSEED. */
const SWEPT = /^(.+)-p\d+-s\d+(-\d+)?$/;
/** The sweeps whose runs are shown, as SESSION/SWEEP. */
const unfolded = signal(/** @type {ReadonlySet<string>} */ (new Set()));

/** The run that the tracking process has open, as SESSION/RUN: it is counted as it goes on. */
const tracked = computed(() => {
  const work = follow("work");
  return work?.run ? `${work.session}/${work.run}` : "";
});

const counted = (count, word) => `${count} ${count === 1 ? word : `${word}s`}`;
const go = (address) => {
  location.href = address;
};

/** Do something and nothing else that a click on the line would do. */
const alone = (act) => (event) => {
  event.stopPropagation();
  act(event);
};

/** Names and facts of a line. */
const Words = ({ name, facts }) =>
  html`<div><div class="name">${name}</div><div class="facts">${facts}</div></div>`;

/**
 * A line of the list: a click or Enter opens it, its button the menu. `own`: attributes that only
 * some lines have.
 * @param {{ id: string, name: string, kind: string, own: Record<string, any>, open: () => void,
 *   menu: (opener: Element) => void, children?: any }} properties
 */
function Line({ id, name, kind, own, open, menu, children }) {
  const press = (event) => {
    if (event.key === "Enter" && event.target === event.currentTarget) open();
  };
  return html`<div
    class=${kind}
    role="treeitem"
    tabindex="0"
    data-key=${id}
    onClick=${open}
    onKeyDown=${press}
    ...${own}
  >
    ${children}
    <button
      class="more"
      aria-label=${`More for ${name}`}
      onClick=${alone((event) => menu(event.currentTarget))}
    >
      ⋯
    </button>
  </div>`;
}

/** How much of a run is tracked. */
const countWords = (done, all) => `${done} of ${all}`;

/** The same of the run that is being tracked, many times a second. */
function LiveCount({ run, title }) {
  const work = follow("work");
  const all = run.last - run.first;
  const words = work?.run
    ? countWords(work.done, work.last - work.first)
    : countWords(run.done, all);
  return html`<small class="done" title=${title}>${words}</small>`;
}

function Count({ id, run, title = "" }) {
  if (id === tracked.value) return html`<${LiveCount} run=${run} title=${title} />`;
  return html`<small class="done" title=${title}>${countWords(run.done, run.last - run.first)}</small>`;
}

/** How far off a run is, and how much of it is tracked. */
function Figures({ id, entry, run }) {
  const measured = run.mean_mm !== null && run.mean_mm !== undefined;
  const all = run.last - run.first;
  const partial = run.done < all;
  const part = partWords(run.measured_frames, run.done);
  const frames = `${countWords(run.done, all)} frames are tracked`;
  const of = measured && (part ? `the mean is${part}` : partial && "the mean is of these only");
  const title = [partial && frames, of].filter(Boolean).join(": ");
  const damaged = run.damaged?.length ?? 0;
  const lost = damaged > 0 ? `Frames ${run.damaged.join(", ")} are damaged on the disk` : "";
  return html`<div class="figure">
    ${measured && html`${figure(run.mean_mm)} <small title=${title}>${partial || part ? "mm, partial " : "mm"}</small>`}
    ${(partial || !measured) && html`<${Count} id=${id} run=${run} title=${title} />`}
    ${
      damaged > 0 &&
      html` <a
        class="damaged"
        href=${studioPath(entry.name, run.name, { frame: run.damaged[0] })}
        title=${`${lost}: resume the run to track them again.`}
        onClick=${(event) => event.stopPropagation()}
        >${damaged} damaged</a
      >`
    }
  </div>`;
}

function RunRow({ entry, run }) {
  const id = `${entry.name}/${run.name}`;
  const isOpen = entry.name === follow("session") && run.name === follow("run");
  return html`<${Line}
    id=${id}
    name=${run.name}
    kind="run"
    own=${{ "aria-selected": String(isOpen) }}
    open=${() => openSession(entry.name, run.name)}
    menu=${(opener) => runMenu(opener, entry, run)}
  >
    <${Words} name=${run.name} facts=${run.describe ?? run.tracker} />
    <${Figures} id=${id} entry=${entry} run=${run} />
  <//>`;
}

const byName = (one, other) => one.name.localeCompare(other.name, "en", { numeric: true });

/** The runs of a sweep, folded under one line. */
function Sweep({ entry, sweep, runs }) {
  const id = `${entry.name}/${sweep}`;
  const holdsOpen =
    entry.name === follow("session") && runs.some((run) => run.name === follow("run"));
  const isOpen = unfolded.value.has(id) || holdsOpen;
  const fold = () => {
    const others = new Set(unfolded.value);
    if (!others.delete(id)) others.add(id);
    unfolded.value = others;
  };
  const press = (event) => {
    if (event.key === "Enter" && event.target === event.currentTarget) fold();
  };
  const result = `/comparisons?${new URLSearchParams({ session: entry.name, name: sweep })}`;
  return html`
    <div
      class="run swept"
      role="treeitem"
      tabindex="0"
      aria-expanded=${String(isOpen)}
      data-key=${id}
      onClick=${fold}
      onKeyDown=${press}
    >
      <${Words} name=${`${isOpen ? "▾" : "▸"} ${sweep}`} facts=${`sweep · ${counted(runs.length, "run")}`} />
      <a class="sweep-result" href=${result} onClick=${(event) => event.stopPropagation()}>result</a>
    </div>
    ${
      isOpen &&
      [...runs]
        .sort(byName)
        .map((run) => html`<${RunRow} key=${run.name} entry=${entry} run=${run} />`)
    }
  `;
}

/** The rows of a session's runs; those of a sweep are folded under one line. */
function Runs({ entry }) {
  const groups = Map.groupBy(entry.runs, (run) => SWEPT.exec(run.name)?.[1] ?? run);
  return [...groups].map(([sweep, runs]) =>
    typeof sweep === "string"
      ? html`<${Sweep} key=${`sweep ${sweep}`} entry=${entry} sweep=${sweep} runs=${runs} />`
      : html`<${RunRow} key=${sweep.name} entry=${entry} run=${sweep} />`,
  );
}

function Picture({ entry }) {
  const [isThere, setThere] = useState(entry.next_step !== "footage");
  if (!isThere) return html`<span class="no-picture"></span>`;
  const address = `${sessionPath(entry.name)}/thumbnail.jpg`;
  return html`<img src=${address} alt="" loading="lazy" onError=${() => setThere(false)} />`;
}

/** What follows for a session: its next step or a run, and trackers compared on it. */
function LastLine({ entry }) {
  const next = entry.next_step;
  return html`<div
    class="last-line"
    role="treeitem"
    tabindex="-1"
    aria-label=${next ? "Next step" : "New run"}
  >
    <button
      type="button"
      class="new-run quiet small"
      onClick=${() => (next ? go(setupPath(entry)) : newRunForm(entry))}
    >
      ${next ? "Continue in the guided set-up" : "+ New run"}
    </button>
    ${
      entry.has_truth &&
      html`<a class="compare" href=${comparisonsPath(entry)}
        >${entry.comparisons ? counted(entry.comparisons, "comparison") : "Compare trackers"}</a
      >`
    }
  </div>`;
}

function Session({ entry }) {
  const isOpen = entry.name === follow("session");
  const fps = figure(entry.fps);
  const size = `${entry.frame_count} frames at ${fps} per second, ${entry.body}`;
  const title = [entry.title, entry.problem || size, ...(entry.warnings ?? [])].join("\n");
  const cameras = `${counted(entry.cameras, "camera")} · ${entry.frame_count} frames`;
  return html`<div class=${isOpen ? "session open" : "session"}>
    <${Line}
      id=${entry.name}
      name=${entry.name}
      kind="head"
      own=${{ "aria-expanded": String(isOpen), title }}
      open=${() => openSession(entry.name)}
      menu=${(opener) => sessionMenu(opener, entry)}
    >
      <${Picture} entry=${entry} />
      <${Words} name=${entry.name} facts=${entry.problem || lacks(entry) || cameras} />
    <//>
    <div class="runs" role="group">
      <${Runs} entry=${entry} />
      <${LastLine} entry=${entry} />
    </div>
  </div>`;
}

function Sessions() {
  const sessions = follow("sessions");
  if (sessions === null) return html`<p class="empty">Loading…</p>`;
  if (!sessions.length) return html`<p class="empty">No sessions yet.</p>`;
  return sessions.map((entry) => html`<${Session} key=${entry.name} entry=${entry} />`);
}

function Trash() {
  const count = restorable.value.length;
  if (!count) return null;
  return html`<div class="rail-foot" id="trash-line">
    ${count} in the trash
    <button
      type="button"
      class="quiet small"
      onClick=${(event) => trashMenu(event.currentTarget)}
    >
      Restore…
    </button>
  </div>`;
}

/** A session or run that went away in another window is closed. */
function closeWhatIsGone() {
  const sessions = get("sessions");
  const entry = sessions?.find((one) => one.name === get("session"));
  if (!sessions || !get("session")) return;
  if (!entry) openSession(sessions[0]?.name ?? null);
  else if (get("run") && !entry.runs.some((run) => run.name === get("run"))) {
    openSession(entry.name);
  }
}

/** Up and down go from line to line. */
function takeArrow(event) {
  const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  const lines = [...byId("sessions").querySelectorAll("[role=treeitem]")].filter(
    (one) => one.offsetParent,
  );
  const at = lines.indexOf(event.target);
  if (!by || at < 0) return;
  event.preventDefault();
  lines[Math.max(0, Math.min(lines.length - 1, at + by))].focus();
}

/** Show the rail. */
export function startRail() {
  byId("import-open").onclick = () => importForm();
  if (!readOnly) acceptDrops("Drop videos or a folder to import them", importForm);
  byId("session-new").onclick = () => go("/way?new");
  byId("sessions").addEventListener("keydown", takeArrow);
  mount(byId("sessions"), html`<${Sessions} />`);
  mount(byId("trash-place"), html`<${Trash} />`);
  watch(["sessions"], () => {
    closeWhatIsGone();
    loadTrash();
  });
}
