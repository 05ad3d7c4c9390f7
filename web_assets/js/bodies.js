// The page of bodies: a list at the left; a body's sizes, limits and markers beside the scene, in
// which it stands with a session's pictures behind it. Every change is made and checked by the
// studio; what comes back is the body's file, so undo is the text before.

import { fault, fetchJson, post, put, readOnly, remove, sessionPath } from "./api.js";
import { openForm } from "./studio/dialogs.js";
import {
  button,
  byId,
  dotted,
  download,
  element,
  failure,
  field,
  fill,
  hint,
  NAME,
  notice,
  offer,
  optional,
  pageHead,
  select,
  text,
} from "./elements.js";
import { complain, say } from "./messages.js";
import { loadScene } from "./scene_window.js";
import { sessionWords, setupPath } from "./sessions.js";
import { startTheme } from "./theme.js";

/** @import { Schemas } from "./api_types" */
/** @typedef {Schemas["BodyDetail"]} Body */

const SIZES = /** @type {const} */ ([
  ["length", "Length"],
  ["radius_start", "Radius, start"],
  ["radius_end", "Radius, end"],
  ["scale_x", "Flat in x"],
  ["scale_y", "Flat in y"],
]);
const LIMITS = /** @type {const} */ ([
  ["lower", "From"],
  ["upper", "To"],
  ["neutral", "At rest"],
  ["max_step", "Most in a second"],
]);
const PARTS = /** @type {const} */ ({ sizes: "Sizes", limits: "Limits", markers: "Markers" });
const REMEMBERED = 200;

const content = byId("content");

/** @type {Schemas["BodyEntry"][]} */
let entries = [];
/** @type {Body | null} */
let body = null;
/** @type {Body[]} */
let past = [];
/** @type {Body[]} */
let undone = [];
let session = "";
let chosen = ""; // the session's own body
let sessions = []; // those with cameras to look through
let part = "sizes";
let wrong = null;
let notes = [];
let changing = Promise.resolve();

const query = (name = "") => {
  const said = new URLSearchParams({
    ...(session ? { session } : {}),
    ...(name ? { body: name } : {}),
  }).toString();
  return said && `?${said}`;
};
const ofSession = () => /** @type {const} */ (`?session=${encodeURIComponent(session)}`);
/** @returns {`/api/bodies/${string}`} */
const pathOf = (name) => `/api/bodies/${encodeURIComponent(name)}`;
const OWN = { session: "this session's", workspace: "yours", "": "" };
/** A number as it is written into a field. */
const written = (value) =>
  value === null || value === undefined ? "" : String(Math.round(value * 1000) / 1000);

// The list.

function drawList() {
  const groups = /** @type {const} */ ([
    ["Your own", entries.filter((one) => one.own)],
    ["Shipped", entries.filter((one) => !one.own)],
  ]);
  fill(
    byId("entries"),
    groups.flatMap(([heading, members]) =>
      members.length
        ? [
            element("h3", {}, heading),
            ...members.map((one) => {
              const row = element(
                "button",
                {
                  type: "button",
                  className: "entry",
                  dataset: { key: one.name },
                  title: one.problem,
                  onclick: () => openBody(one.name).catch(complain),
                },
                element("span", { className: "name" }, one.name),
                element(
                  "span",
                  { className: "mark" },
                  one.problem ? "unreadable" : one.name === chosen ? "in use" : OWN[one.own],
                ),
                element("span", { className: "facts" }, one.problem || one.title),
              );
              if (one.name === body?.name) row.ariaCurrent = "true";
              return row;
            }),
          ]
        : [],
    ),
  );
}

async function refresh() {
  ({ bodies: entries, chosen } = await fetchJson(`/api/bodies${ofSession()}`));
  drawList();
}

async function openBody(name) {
  const known = entries.find((one) => one.name === name);
  if (known?.problem) {
    say(known.problem, { kind: "error" });
    return;
  }
  show(await fetchJson(`${pathOf(name)}${ofSession()}`));
}

/** Show a body that was opened, with nothing to undo. @param {Body} opened */
function show(opened) {
  [body, past, undone, wrong, notes] = [opened, [], [], null, []];
  history.replaceState(null, "", query(opened.name));
  document.title = `${opened.name} · Bodies`;
  drawList();
  draw();
}

// Changes, one after the other.

/** @param {() => void | Promise<void>} change */
const inTurn = (change) => (changing = changing.then(change));

/** @param {Partial<Schemas["BodyEdit"]>} change @param {HTMLInputElement | null} [input] */
function apply(change, input = null) {
  return inTurn(async () => {
    const before = body;
    if (!before) return;
    try {
      const changed = await post(
        `${pathOf(before.name)}/edit`,
        /** @type {any} */ ({ ...change, text: before.text }),
      );
      if (changed.text !== before.text) {
        past = [...past, before].slice(-REMEMBERED);
        undone = [];
      }
      [body, wrong, notes] = [changed, null, changed.notes];
      draw();
    } catch (error) {
      wrong = error;
      input?.setAttribute("aria-invalid", "true");
      drawSaid();
    }
  });
}

/** @param {Body[]} from @param {Body[]} to */
function step(from, to) {
  const next = from.pop();
  if (!next || !body) return;
  to.push(body);
  body = next;
  [wrong, notes] = [null, []];
  draw();
}
const undo = () => inTurn(() => step(past, undone));
const redo = () => inTurn(() => step(undone, past));

/** A number of the body; its name in the request is `key`. */
function entry(label, value, send, more = {}) {
  const input = element("input", {
    type: "number",
    step: "any",
    value: written(value),
    ariaLabel: label,
    disabled: readOnly,
    dataset: { key: label },
    ...more,
  });
  input.onchange = () => {
    if (input.value === written(value)) return;
    const typed = input.value.trim();
    // A field that holds no number is empty to the page: only where nothing may be written is that
    // meant.
    if (typed === "" && (!more.free || input.validity.badInput)) {
      wrong = fault(`${label} is no number.`, "Write one, or undo.");
      input.setAttribute("aria-invalid", "true");
      drawSaid();
      return;
    }
    send(typed === "" ? null : Number(typed), input);
  };
  return input;
}

// The parts of a body.

/** @param {Body} body */
function sizesTable(body) {
  const seen = new Set();
  const rows = body.limbs.map((limb) =>
    element(
      "tr",
      {},
      element(
        "th",
        { scope: "row" },
        element("i", { className: `side-swatch ${limb.side}` }),
        limb.name,
      ),
      SIZES.map(([key, words]) => {
        const { value, dimension } = limb[key];
        const shared = dimension && seen.has(dimension);
        seen.add(dimension);
        return element(
          "td",
          {},
          entry(
            `${limb.name}, ${words.toLowerCase()}`,
            value,
            (typed, input) => apply({ sizes: { [`${limb.name}.${key}`]: typed } }, input),
            {
              min: 0,
              className: shared ? "shared" : "",
              title: dimension
                ? `Dimension ${dimension}${shared ? ", shared with a limb above" : ""}`
                : "",
            },
          ),
        );
      }),
    ),
  );
  const others = body.dimensions.map((one) =>
    element(
      "tr",
      {},
      element("th", { scope: "row" }, one.name.replaceAll("_", " ")),
      element(
        "td",
        {},
        entry(
          one.name.replaceAll("_", " "),
          one.value,
          (typed, input) => apply({ sizes: { [one.name]: typed } }, input),
          { min: 0 },
        ),
      ),
      element("td", { className: "unit" }, one.unit),
    ),
  );
  return [
    hint("Millimetres. A limb is a cone; flat in x or y makes it an ellipse across."),
    element(
      "table",
      { className: "parts" },
      element(
        "thead",
        {},
        element(
          "tr",
          {},
          element("th", {}, "Limb"),
          SIZES.map(([, words]) => element("th", {}, words)),
        ),
      ),
      element("tbody", {}, rows),
    ),
    others.length > 0 && [
      element("h3", {}, "Where joints and markers lie"),
      element("table", { className: "parts narrow" }, element("tbody", {}, others)),
    ],
  ];
}

/** @param {Body} body */
function limitsTable(body) {
  let group = "";
  const rows = body.limits.flatMap((one) => {
    const head =
      one.limb !== group &&
      element(
        "tr",
        { className: "group" },
        element("th", { colSpan: LIMITS.length + 1 }, one.limb),
      );
    group = one.limb;
    const row = element(
      "tr",
      {},
      element("th", { scope: "row", title: one.name }, one.label),
      LIMITS.map(([key, words]) => {
        const free = key === "lower" || key === "upper";
        const none = key === "lower" ? "-inf" : "inf";
        return element(
          "td",
          {},
          key === "neutral" && one.neutral === null
            ? element("span", { className: "quiet-text" }, "by sizes")
            : entry(
                `${one.label}, ${words.toLowerCase()}`,
                one[key],
                (typed, input) =>
                  apply(
                    { limits: /** @type {any} */ ({ [`${one.name}.${key}`]: typed ?? none }) },
                    input,
                  ),
                { free, placeholder: free ? "none" : "" },
              ),
        );
      }),
    );
    return head ? [head, row] : [row];
  });
  return [
    hint("Degrees, and millimetres for lengths. An empty field is no limit."),
    element(
      "table",
      { className: "parts" },
      element(
        "thead",
        {},
        element(
          "tr",
          {},
          element("th", {}, "Angle"),
          LIMITS.map(([, words]) => element("th", {}, words)),
        ),
      ),
      element("tbody", {}, rows),
    ),
  ];
}

/** @param {Body} body */
function markersTable(body) {
  const marker = (name, joint, at) => `${name}=${joint},${at.join(",")}`;
  const rows = body.markers.map((one) =>
    element(
      "tr",
      {},
      element("th", { scope: "row" }, one.name),
      element("td", {}, one.joint),
      one.at.map((value, axis) =>
        element(
          "td",
          {},
          entry(`${one.name}, ${"xyz"[axis]}`, value, (typed, input) =>
            apply({ markers: [marker(one.name, one.joint, one.at.with(axis, typed))] }, input),
          ),
        ),
      ),
      element(
        "td",
        {},
        !readOnly &&
          button("×", () => apply({ without_markers: [one.name] }), "icon quiet small", {
            ariaLabel: `Remove ${one.name}`,
          }),
      ),
    ),
  );
  const name = text({
    placeholder: "Name",
    ariaLabel: "Name of the new marker",
    maxLength: 40,
    dataset: { key: "new-marker" },
  });
  const joint = select(body.joints, body.joints[0], { ariaLabel: "Joint of the new marker" });
  const add = () => apply({ markers: [marker(name.value.trim(), joint.value, [0, 0, 0])] });
  name.onkeydown = (event) => {
    if (event.key === "Enter") add();
  };
  return [
    hint(
      "Named points that go with a joint: what is exported, and what a truth or measured lengths name. Millimetres in the joint's frame.",
    ),
    element(
      "table",
      { className: "parts" },
      element(
        "thead",
        {},
        element(
          "tr",
          {},
          ["Marker", "Joint", "x", "y", "z", ""].map((words) => element("th", {}, words)),
        ),
      ),
      element("tbody", {}, rows),
    ),
    !readOnly &&
      element("div", { className: "form-foot" }, name, joint, button("Add a marker", add)),
  ];
}

// The page.

const said = optional();
const form = element("div", { className: "body-form" });
const aside = element("div", { className: "body-scene" });
const behind = element("select", { onchange: () => turnTo(behind.value).catch(complain) });
const through = element("select", {
  onchange: () => post("/api/scene/view", { look_through: through.value || null }).catch(complain),
});

function drawSaid() {
  fill(said, failure(wrong), ...notes.map((words) => notice(words)));
}

function draw() {
  const shown = body;
  if (!shown) return;
  if (!content.contains(form)) {
    fill(
      content,
      element(
        "div",
        { className: "body-bench" },
        form,
        element(
          "section",
          { className: "body-view", ariaLabel: "The body" },
          element(
            "div",
            { className: "body-bar" },
            field("Pictures behind it", behind),
            field("Seen", through),
          ),
          aside,
        ),
      ),
    );
    fill(aside, loadScene(element("iframe", { title: "3-D scene" })));
  }
  const own = entries.find((one) => one.name === shown.name)?.own;
  const tabs = Object.entries(PARTS).map(([key, words]) =>
    element(
      "button",
      {
        type: "button",
        role: "tab",
        dataset: { key },
        ariaSelected: String(key === part),
        onclick: () => {
          part = key;
          draw();
        },
      },
      words,
    ),
  );
  const table = { sizes: sizesTable, limits: limitsTable, markers: markersTable }[part](shown);
  fill(
    form,
    pageHead(
      shown.name,
      dotted(shown.title, past.length > 0 && "changed, not saved"),
      !readOnly && own && button("Delete…", () => removeForm(shown.name, own)),
      button(
        "TOML",
        () => download(`${shown.name}.toml`, new Blob([shown.text], { type: "application/toml" })),
        "",
        { title: "The body's file" },
      ),
      !readOnly && button("Save…", () => saveForm(shown), "primary"),
    ),
    !readOnly &&
      element(
        "div",
        { className: "form-foot" },
        button("Undo", undo, "", { disabled: !past.length, title: "Ctrl+Z" }),
        button("Redo", redo, "", { disabled: !undone.length, title: "Ctrl+Y" }),
        button("Left → right", () => apply({ mirror: "left" }), "", {
          disabled: !shown.sided,
          title: "The right side becomes the left one's mirror image",
        }),
        button("Right → left", () => apply({ mirror: "right" }), "", {
          disabled: !shown.sided,
          title: "The left side becomes the right one's mirror image",
        }),
      ),
    said,
    element(
      "div",
      { className: "part-tabs", role: "tablist", ariaLabel: "Parts of the body" },
      tabs,
    ),
    ...table.filter(Boolean).flat(2),
  );
  drawSaid();
  post("/api/scene/show", { ...(session ? { session } : {}), body: shown.text }).catch(complain);
}

/** @param {Body} shown */
function saveForm(shown) {
  const own = entries.find((one) => one.name === shown.name)?.own;
  const places = [
    ...(session ? [{ value: "session", label: `session ${session}` }] : []),
    { value: "workspace", label: "all sessions of this workspace" },
  ];
  openForm({
    heading: "Save as your own",
    action: "Save",
    intro: "Shipped bodies stay as they are; runs keep the copy that they were made with.",
    rows: [
      [{ name: "name", label: "Name", value: own ? shown.name : "", ...NAME }],
      [{ name: "title", label: "Title", value: shown.title, maxLength: 200 }],
      [{ name: "place", label: "For", choices: places, value: own || places[0].value }],
      [
        {
          name: "replace",
          kind: "check",
          label: "replace the one of that name",
          value: Boolean(own),
        },
      ],
      ...(session
        ? [[{ name: "use", kind: "check", label: `track session ${session} with it`, value: true }]]
        : []),
    ],
    send: async (values) => {
      // What was typed last is saved, too; what was refused is in its field still, and not in the
      // body.
      await changing;
      if (wrong) throw wrong;
      const saved = await post(`${pathOf(shown.name)}/edit`, {
        text: (body ?? shown).text,
        title: values.title,
        save_as: values.name,
        replace: values.replace,
        session: values.place === "session" ? session : null,
      });
      if (values.use) await put(`${sessionPath(session)}/subject`, { body: saved.saved });
      await refresh();
      show({ ...saved, name: saved.saved });
      const next = session
        ? element(
            "a",
            { href: `${setupPath({ name: session })}&step=subject` },
            "Go on in the guided set-up",
          )
        : null;
      say(`${saved.saved} is saved${values.use ? `, and ${session} is tracked with it` : ""}.`, {
        act: next,
      });
    },
  });
}

function removeForm(name, own) {
  openForm({
    heading: `Delete ${name}?`,
    action: "Delete",
    danger: true,
    rows: [],
    intro: "It goes to the trash of the workspace. Runs keep the copy that they were made with.",
    send: async () => {
      await remove(
        `${pathOf(name)}?session=${own === "session" ? encodeURIComponent(session) : ""}`,
      );
      await refresh();
      await openBody(chosen || entries[0].name);
    },
  });
}

/** The form that takes a body's file. */
function fileForm() {
  openForm({
    heading: "A body's file",
    action: "Open",
    intro:
      "A TOML file of the format that the guide describes. It is opened here; Save makes it yours.",
    rows: [[{ name: "files", label: "File", kind: "file", accept: ".toml", required: true }]],
    send: async ({ files }) => {
      const name = files[0].name.replace(/\.toml$/i, "").replace(/[^A-Za-z0-9_-]+/g, "-") || "body";
      const opened = await post(`${pathOf(name)}/edit`, { text: await files[0].text() });
      show(opened);
    },
  });
}

/** Put a session's pictures behind the body; "" none. */
async function turnTo(name) {
  session = name;
  await refresh();
  const detail = session ? await fetchJson(sessionPath(session)) : null;
  offer(
    through,
    [
      ["", "freely"],
      ...(detail?.cameras ?? []).map(
        (camera) => /** @type {[string, string]} */ ([camera.name, `by camera ${camera.name}`]),
      ),
    ],
    "",
  );
  through.disabled = !session;
  if (body) {
    history.replaceState(null, "", query(body.name));
    draw();
  }
}

function takeKey(event) {
  if (!(event.ctrlKey || event.metaKey) || event.altKey || event.target.closest?.("dialog")) return;
  const act = { z: event.shiftKey ? redo : undo, y: redo }[event.key.toLowerCase()];
  if (!act || readOnly) return;
  event.preventDefault();
  act();
}

async function start() {
  startTheme();
  document.addEventListener("keydown", takeKey);
  const wanted = new URLSearchParams(location.search);
  const open = byId("new");
  [open.textContent, open.onclick, open.hidden] = ["Open a file…", fileForm, readOnly];
  sessions = (await fetchJson("/api/sessions")).sessions.filter(
    (one) => !one.problem && !one.next_step,
  );
  const name = wanted.get("session") ?? "";
  const isKnown = sessions.some((one) => one.name === name);
  offer(
    behind,
    [
      ["", "none"],
      ...sessions.map((one) => /** @type {[string, string]} */ ([one.name, sessionWords(one)])),
    ],
    isKnown ? name : "",
  );
  if (name && !isKnown)
    say(`Session ${name} has no calibrated pictures to put behind a body.`, {
      remedy: "Bodies can be made without.",
    });
  await turnTo(isKnown ? name : "");
  await openBody(wanted.get("body") || chosen || entries[0].name);
}

start().catch(complain);
