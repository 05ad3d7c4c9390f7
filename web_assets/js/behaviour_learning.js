// Learning a model: the form, and the card that tells how far it is.

import { fetchJson, post } from "./api.js";
import { button, element } from "./elements.js";
import { isGoing, withTimeLeft } from "./jobs.js";
import { uploadFiles } from "./uploading.js";

const USES = [["", "–"], ["learn", "learn"], ["test", "test"]];

const labelled = (words, input, hint = "") => element("label", {}, words, input, hint && element("span", { className: "hint", textContent: hint }));
const option = (value, label, selected) => new Option(label, value, false, value === selected);

/** One knob as a field, from its declaration. */
function knobField(knob) {
  const input = knob.choices.length
    ? element("select", { name: knob.name }, ...knob.choices.map((one) => option(one, one, knob.default)))
    : element("input", { name: knob.name, type: "number", value: knob.default, min: knob.low, max: knob.high, step: knob.step ?? "any", required: true });
  const label = labelled(knob.unit ? `${knob.label} (${knob.unit})` : knob.label, input);
  label.title = knob.help;
  return label;
}

/** The knobs under their groups' titles, each folded away. */
function knobGroups(knobs) {
  const groups = Map.groupBy ? Map.groupBy(knobs, (knob) => knob.group) : knobs.reduce((all, knob) => all.set(knob.group, [...(all.get(knob.group) ?? []), knob]), new Map());
  return [...groups].map(([group, members]) => element("details", { className: "card-box" },
    element("summary", { textContent: group }), element("div", { className: "fields" }, ...members.map(knobField))));
}

/** A row a run that holds something: whether it is learnt from, tested on, or left alone. */
function runRows(sessions) {
  const rows = sessions.flatMap((session) => (session.runs ?? []).filter((run) => run.done > 1).map((run) => {
    const source = `${session.name}/${run.name}`;
    const use = element("select", { ariaLabel: `What ${source} is for` }, ...USES.map(([value, label]) => option(value, label, "")));
    use.dataset.source = source;
    return element("tr", {}, element("td", { textContent: session.name }), element("td", { textContent: run.name }),
      element("td", { textContent: `${run.done} frames` }), element("td", {}, use));
  }));
  if (!rows.length) return element("p", { className: "hint", textContent: "No run has any frames yet." });
  return element("div", { className: "scrolls low-list" }, element("table", { className: "figures" },
    element("thead", {}, element("tr", {}, ...["session", "run", "", "use"].map((head) => element("th", { textContent: head })))), element("tbody", {}, ...rows)));
}

/** What the form asks for, as `POST /api/learning` takes it, but for the upload. */
function read(form, knobs) {
  const chosen = (use) => [...form.querySelectorAll("select[data-source]")].filter((one) => one.value === use).map((one) => one.dataset.source);
  const changed = knobs.filter((knob) => form.elements[knob.name].value !== String(knob.default))
    .map((knob) => [knob.name, knob.choices.length ? form.elements[knob.name].value : Number(form.elements[knob.name].value)]);
  return { name: form.elements.name.value.trim(), body: form.elements.body.value, fps: Number(form.elements.fps.value), sources: chosen("learn"), tests: chosen("test"), settings: Object.fromEntries(changed) };
}

/** Show the form in `content`. choices: as `GET /api/learning` has them. started: called when it has begun. */
export function showLearningForm(content, { choices, sessions, started }) {
  const wrong = element("p", { className: "wrong", hidden: true, role: "alert" });
  const remedy = element("p", { className: "hint", hidden: true });
  const files = element("input", { type: "file", name: "files", multiple: true, accept: choices.endings.join(",") });
  const submit = element("button", { className: "primary", textContent: "Learn" });
  const form = element("form", { className: "compare-form" },
    element("div", { className: "card-box" }, element("div", { className: "fields" },
      labelled("Name of the model", element("input", { name: "name", required: true, pattern: "[A-Za-z0-9_\\-]{1,64}", title: "Letters, digits, - and _, up to 64" })),
      labelled("Body", element("select", { name: "body" }, ...choices.bodies.map((one) => option(one, one, choices.default_body)))),
      labelled("Frames per second", element("input", { name: "fps", type: "number", min: 5, max: 240, step: "any", value: choices.fps, required: true })))),
    element("div", { className: "card-box" }, element("h2", { textContent: "Learnt from" }),
      labelled(`Motion files (${choices.endings.join(" ")}); an .amc comes with its .asf`, files),
      runRows(sessions),
      element("p", { className: "hint", textContent: "Where nothing is chosen for the test, the last fifth of each source is." })),
    ...knobGroups(choices.knobs),
    wrong, remedy, element("div", { className: "form-foot" }, submit, element("span", { className: "hint", textContent: "In the background; the studio can be used meanwhile." })));
  form.onsubmit = async (event) => {
    event.preventDefault();
    submit.disabled = true;
    wrong.hidden = remedy.hidden = true;
    try {
      const wish = read(form, choices.knobs);
      if (files.files.length) wish.upload = await uploadFiles(files.files, (words) => { submit.textContent = words; });
      submit.textContent = "Beginning…";
      started(await post("/api/learning", wish));
    } catch (error) {
      wrong.textContent = error.message;
      remedy.textContent = error.hint ?? "";
      wrong.hidden = false;
      remedy.hidden = !error.hint;
      wrong.scrollIntoView({ block: "nearest" });
    } finally {
      submit.disabled = false;
      submit.textContent = "Learn";
    }
  };
  content.replaceChildren(element("div", { className: "column" },
    element("header", { className: "head" }, element("div", {}, element("h1", { textContent: "Learn a behaviour" }),
      element("p", { className: "lead", textContent: "Recorded motion and earlier runs are put on one body, taken several times with other smoothing, clustered into elementary movements, and their order is learnt." }))),
    form));
  form.elements.name.focus();
}

/** What is said of progress in one line. */
export const progressWords = (told) => (isGoing(told) ? withTimeLeft(told, "beginning") : told.state);

/** The card of what is being learnt, or of why it was not. again: called for another form. */
export function showLearning(content, progress, { cancel, again }) {
  const running = isGoing(progress);
  const bar = element("i");
  bar.style.width = `${progress.total ? (100 * progress.done) / progress.total : 0}%`;
  const told = { cancelled: "It was cancelled; nothing of it was kept.", failed: progress.message }[progress.state] ?? "";
  content.replaceChildren(element("div", { className: "column" },
    element("header", { className: "head" }, element("div", {}, element("h1", { textContent: progress.name }),
      element("p", { className: "lead", textContent: `body ${progress.body}` })),
    running ? button("Cancel", cancel) : button("Try again", again)),
    element("section", { className: "card-box", id: "learning" },
      running ? element("p", { className: "lead words-of-progress", textContent: progressWords(progress) }) : element("p", { className: "wrong", textContent: told }),
      running && element("div", { className: "long-progress" }, bar),
      !running && progress.hint && element("p", { className: "lead", textContent: progress.hint }))));
}

/** Bring the card up to date where it shows one in the making; whether it did. */
export function updateLearning(content, progress) {
  const card = content.querySelector("#learning");
  const words = card?.querySelector(".words-of-progress");
  if (!words || !isGoing(progress)) return false;
  words.textContent = progressWords(progress);
  card.querySelector(".long-progress i").style.width = `${progress.total ? (100 * progress.done) / progress.total : 0}%`;
  return true;
}

/** How it stands now. */
export const learningChoices = () => fetchJson("/api/learning");
