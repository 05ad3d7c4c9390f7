// The course as a column beside the scene. What is scrolled to is shown: each link into the studio
// is a state of the page, and the last one above the middle of the column is opened. A link that
// names a knob is a number to be dragged.

import { fetchJson, post, readOnly } from "../api.js";
import { askOnEach } from "../events.js";
import { isGoing } from "../jobs.js";
import { complain } from "../messages.js";
import { paced } from "../pacing.js";
import { html, into, mount, signal, useEffect, useMemo, useRef, useState } from "./component.js";
import { Select } from "./parts.js";
import { visit } from "./visiting.js";
import { useKnob } from "./knob.js";

const PAGES = [
  { name: "arm", title: "An arm of four links" },
  { name: "particle", title: "What a particle is" },
  { name: "layer", title: "Why one layer fails" },
  { name: "annealing", title: "What annealing changes" },
  { name: "partitions", title: "What partitions and behaviour add" },
];
const SETTLE_MILLISECONDS = 250;
const PACE_MILLISECONDS = 300;
/** A whole range of a knob is dragged in so many pixels. */
const DRAG_PIXELS = 240;
const KEPT = "course-page";

const isOpen = signal(false);
const page = signal("arm");

/** Dock the course beside the scene. @param {string} [name] */
export function openCourse(name = "") {
  if (PAGES.some((one) => one.name === name)) page.value = name;
  isOpen.value = true;
}

/** The states that the links of a text lead to. @param {HTMLElement} place */
function statesOf(place) {
  const links = /** @type {HTMLAnchorElement[]} */ ([...place.querySelectorAll("a[href^='/?']")]);
  return links.filter((link) => !new URL(link.href).searchParams.has("knob"));
}

/** @param {HTMLAnchorElement} link @param {HTMLElement} place */
function show(link, place) {
  for (const one of place.querySelectorAll(".shown")) one.classList.remove("shown");
  (link.closest("p, li") ?? link).classList.add("shown");
  const query = new URL(link.href).searchParams;
  visit(Object.fromEntries(query));
}

/**
 * A number in a sentence, dragged or turned by the arrow keys.
 * @param {{ name: string, words: string }} properties
 */
function KnobNumber({ name, words }) {
  const knob = useKnob(name);
  const from = useRef({ x: 0, value: 0 });
  if (!knob) return html`<b>${words}</b>`;
  const wide = knob.high - knob.low;
  const exact = (/** @type {number} */ value) => Math.round(value / knob.step) * knob.step;
  const digits = Math.max(0, Math.min(3, Math.ceil(-Math.log10(knob.step))));
  const down = (/** @type {any} */ event) => {
    if (readOnly) return;
    event.target.setPointerCapture(event.pointerId);
    from.current = { x: event.clientX, value: knob.value };
  };
  const move = (/** @type {any} */ event) => {
    if (!event.target.hasPointerCapture(event.pointerId)) return;
    const by = ((event.clientX - from.current.x) / DRAG_PIXELS) * Math.min(wide, 100 * knob.step);
    knob.turn(exact(from.current.value + by));
  };
  const press = (/** @type {any} */ event) => {
    /** @type {Record<string, number>} */
    const steps = {
      ArrowRight: 1,
      ArrowUp: 1,
      ArrowLeft: -1,
      ArrowDown: -1,
      PageUp: 10,
      PageDown: -10,
    };
    const by = steps[event.key];
    if (!by || readOnly) return;
    event.preventDefault();
    event.stopPropagation();
    knob.turn(exact(knob.value + by * knob.step));
  };
  return html`<span
    class="knob-number"
    role="slider"
    tabindex="0"
    aria-label=${name.replaceAll("_", " ")}
    aria-valuemin=${knob.low}
    aria-valuemax=${knob.high}
    aria-valuenow=${knob.value}
    aria-disabled=${String(readOnly)}
    title="Drag, or use the arrow keys: the frame is searched again"
    onPointerDown=${down}
    onPointerMove=${move}
    onKeyDown=${press}
    >${knob.value.toFixed(digits)}</span
  >`;
}

/**
 * Whether the runs that a page speaks of are there; they are made here.
 * @param {{ name: string }} properties
 */
function Runs({ name }) {
  const [course, setCourse] = useState(/** @type {any} */ (null));
  const look = useMemo(
    () =>
      paced(async () => {
        try {
          setCourse(await fetchJson("/api/course"));
        } catch (error) {
          complain(error);
        }
      }, PACE_MILLISECONDS),
    [],
  );
  useEffect(() => {
    look();
    return askOnEach("course", look);
  }, [name]);
  const missing = (course?.runs ?? []).filter((/** @type {any} */ one) => !one.there);
  if (!missing.length) return null;
  const make = async () => {
    await post("/api/course").catch(complain);
    look();
  };
  const share = course?.job?.total ? course.job.done / course.job.total : 0;
  return html`<div class="course-runs" role="status">
    ${
      isGoing(course?.job)
        ? html`<div>
            Making the course's runs: ${course.job.step ?? ""}
            <div class="long-progress"><i style=${`width: ${100 * share}%`}></i></div>
          </div>`
        : html`<p class="hint">
              ${missing.length} runs of the course are not made yet; some links need them.
            </p>
            ${!readOnly && html`<button class="small" onClick=${make}>Make them</button>`}`
    }
  </div>`;
}

/**
 * The text of a page of the guide, its links and knobs alive.
 * @param {{ name: string }} properties
 */
function Lesson({ name }) {
  const place = useRef(/** @type {any} */ (null));
  useEffect(() => {
    const column = /** @type {HTMLElement} */ (place.current);
    let isGone = false;
    let timer = 0;
    let last = "";
    const follow = () => {
      const middle = column.getBoundingClientRect().top + column.clientHeight * 0.4;
      const above = statesOf(column).filter((link) => link.getBoundingClientRect().top < middle);
      const link = above.at(-1);
      if (!link || link.href === last) return;
      last = link.href;
      show(link, column);
    };
    const scrolled = () => {
      clearTimeout(timer);
      timer = window.setTimeout(follow, SETTLE_MILLISECONDS);
    };
    const clicked = (/** @type {any} */ event) => {
      const link = event.target.closest("a");
      if (!link) return;
      const { pathname } = new URL(link.href);
      const next = PAGES.find((one) => pathname === `/guide/${one.name}`);
      if (next) {
        event.preventDefault();
        page.value = next.name;
      } else if (statesOf(column).includes(link)) {
        event.preventDefault();
        last = link.href;
        show(link, column);
      }
    };
    const load = async () => {
      const text = await (await fetch(`/guide/${name}`)).text();
      if (isGone) return;
      const found = new DOMParser().parseFromString(text, "text/html").getElementById("content");
      column.replaceChildren(...(found?.childNodes ?? []));
      column.scrollTop = 0;
      for (const link of column.querySelectorAll("a[href*='knob=']")) {
        const knob = new URL(/** @type {HTMLAnchorElement} */ (link).href).searchParams.get("knob");
        const own = document.createElement("span");
        link.replaceWith(own);
        mount(own, html`<${KnobNumber} name=${knob} words=${link.textContent} />`);
      }
      follow();
    };
    load().catch(complain);
    column.addEventListener("scroll", scrolled, { passive: true });
    column.addEventListener("click", clicked);
    return () => {
      isGone = true;
      clearTimeout(timer);
      column.removeEventListener("scroll", scrolled);
      column.removeEventListener("click", clicked);
    };
  }, [name]);
  return html`<div class="course-text" ref=${place} tabindex="0" role="region" aria-label="Lesson"></div>`;
}

function CourseColumn() {
  useEffect(() => {
    const place = /** @type {HTMLElement} */ (document.getElementById("course-column"));
    place.hidden = !isOpen.value;
    if (isOpen.value) localStorage.setItem(KEPT, page.value);
    else localStorage.removeItem(KEPT);
  }, [isOpen.value, page.value]);
  if (!isOpen.value) return null;
  return html`<div class="course-head">
      <${Select}
        aria-label="Lesson"
        options=${PAGES.map(({ name, title }, index) => [name, `${index + 1}. ${title}`])}
        value=${page.value}
        take=${into(page)}
      />
      <button
        class="icon"
        aria-label="Close the course"
        title="Close the course"
        onClick=${() => into(isOpen)(false)}
      >
        ×
      </button>
    </div>
    <div class="course-body">
      <${Runs} name=${page.value} />
      <${Lesson} name=${page.value} />
    </div>`;
}

/**
 * Show the course where it was docked before, or where the address asks for it (`course=LESSON`).
 */
export function startCourseColumn() {
  const place = /** @type {HTMLElement} */ (document.getElementById("course-column"));
  const wanted = new URLSearchParams(location.search).get("course") ?? localStorage.getItem(KEPT);
  if (wanted) openCourse(wanted);
  mount(place, html`<${CourseColumn} />`);
}
