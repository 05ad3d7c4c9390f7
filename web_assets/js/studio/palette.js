// The command palette: all that can be found, by a few letters of its name.

import { byId } from "../elements.js";
import { html, into, mount, signal, useEffect, useLayoutEffect, useRef } from "./component.js";
import { askForFindable, findable } from "./findable.js";

/** @import { Entry } from "./findable.js" */

const MOST = 40;
const WHAT = "A view, a knob, a frame, a limb, a page, a run, help …";
const isOpen = signal(false);
/** What is looked for, and which of what is found is chosen. */
const search = signal({ words: "", chosen: 0 });
const answers = signal(0); // how often there was more to find

/**
 * How well words fit what is looked for; -1: not at all.
 * @param {Entry} entry
 * @param {string} wanted
 */
function fit({ words, more, kind, also = "" }, wanted) {
  const text = `${words} ${more} ${kind} ${also}`.toLowerCase();
  if (kind === "Frame") return 4;
  if (!wanted.split(" ").every((part) => text.includes(part))) return -1;
  const name = words.toLowerCase();
  if (name.startsWith(wanted)) return 3;
  // A word of its name that begins so comes before letters inside of one, and those before what
  // only its help says.
  if (` ${name}`.includes(` ${wanted}`)) return 2;
  return name.includes(wanted) ? 1 : 0;
}

/** The best of what can be found. @param {string} wanted */
function bestOf(wanted) {
  const scored = findable(wanted).map((entry) => ({ entry, score: fit(entry, wanted) }));
  return scored
    .filter(({ score }) => score >= 0)
    .sort((a, b) => b.score - a.score)
    .slice(0, MOST)
    .map(({ entry }) => entry);
}

/** @param {{ entry: Entry, id: string, isChosen: boolean, take: () => void }} properties */
function Option({ entry, id, isChosen, take }) {
  const line = useRef(/** @type {HTMLElement | null} */ (null));
  useLayoutEffect(() => {
    if (isChosen) line.current?.scrollIntoView({ block: "nearest" });
  }, [isChosen]);
  return html`<li ref=${line} id=${id} role="option" aria-selected=${String(isChosen)} onClick=${take}>
    <span class="kind">${entry.kind}</span>${entry.words}<small>${entry.more}</small>
  </li>`;
}

function Search() {
  answers.value;
  const field = useRef(/** @type {HTMLInputElement | null} */ (null));
  const found = bestOf(search.value.words.trim().toLowerCase());
  const chosen = Math.min(search.value.chosen, Math.max(0, found.length - 1));
  const take = (/** @type {number} */ at) => {
    // Before it acts: a dialog that closes gives the focus back to where it was.
    field.current?.closest("dialog")?.close();
    isOpen.value = false;
    found[at]?.act();
  };
  const takeKey = (/** @type {KeyboardEvent} */ event) => {
    const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!by && event.key !== "Enter") return;
    event.preventDefault();
    if (!by) return take(chosen);
    const next = (chosen + by + found.length) % Math.max(1, found.length);
    search.value = { ...search.value, chosen: next };
  };
  useEffect(() => {
    askForFindable(() => {
      answers.value += 1;
    });
  }, []);
  return html`<div class="palette-box">
    <input
      ref=${field}
      type="text"
      placeholder=${WHAT}
      aria-label="Find"
      role="combobox"
      aria-expanded="true"
      aria-controls="palette-list"
      aria-activedescendant=${`palette-${chosen}`}
      autocomplete="off"
      value=${search.value.words}
      onInput=${({ currentTarget }) => {
        search.value = { words: currentTarget.value, chosen: 0 };
      }}
      onKeyDown=${takeKey}
    />
    <ul class="palette-list" role="listbox" aria-label="What there is" id="palette-list">
      ${found.map(
        (entry, at) =>
          html`<${Option}
            key=${at}
            id=${`palette-${at}`}
            entry=${entry}
            isChosen=${at === chosen}
            take=${() => take(at)}
          />`,
      )}
      ${!found.length && html`<li class="empty">Nothing is called that.</li>`}
    </ul>
  </div>`;
}

/** The dialog; what is in it is there while it is open. */
function Palette() {
  const dialog = useRef(/** @type {HTMLDialogElement | null} */ (null));
  useLayoutEffect(() => {
    if (isOpen.value) dialog.current?.showModal();
    else dialog.current?.close();
  }, [isOpen.value]);
  // A dialog says a little later that it closed: it may be open again by then.
  const closed = ({ currentTarget }) => into(isOpen)(currentTarget.open);
  const takeKey = (/** @type {KeyboardEvent} */ event) => {
    if (event.key !== "Escape") return;
    event.preventDefault();
    isOpen.value = false;
  };
  return html`
    <dialog ref=${dialog} class="palette" aria-label="Find" onClose=${closed} onKeyDown=${takeKey}>
      ${isOpen.value && html`<${Search} />`}
    </dialog>
  `;
}

/** Open it, or close it again. */
export function togglePalette() {
  search.value = { words: "", chosen: 0 };
  isOpen.value = !isOpen.value;
}

/** Wire its key. */
export function startPalette() {
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "k") return;
    event.preventDefault();
    togglePalette();
  });
  mount(byId("palette-place"), html`<${Palette} />`);
}
