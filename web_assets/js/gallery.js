// The gallery: a card for every session that can be opened or made. What can be made here is made
// at a click, as work in the background.

import { fetchJson, post, readOnly, remove } from "./api.js";
import {
  actions,
  button,
  byId,
  drawProgress,
  element,
  failure,
  fill,
  hint,
  nothing,
  optional,
  pageHead,
} from "./elements.js";
import { followJob, isGoing, progressOf } from "./jobs.js";
import { complain } from "./messages.js";
import { setupPath, studioPath } from "./sessions.js";
import { startTheme } from "./theme.js";

/** @import { Schemas } from "./api_types" */
/** @typedef {Schemas["CardView"]} Card */

const KINDS = {
  sample: "comes with the studio",
  recipe: "rendered, with exact truth",
  elsewhere: "not shipped",
};
const MAKE = { sample: "Open", recipe: "Render", elsewhere: "Import" };

const grid = element("div", { className: "gallery" });
/** @returns {`/api/gallery/${string}`} */
const pathOf = (name) => `/api/gallery/${encodeURIComponent(name)}`;

/** Where a card's session is. @param {Card} card */
const placeOf = (card) =>
  card.session === card.name ? "in this workspace" : `in this workspace as ${card.session}`;

/** What the commands do that are left after the making of a card, such as "track, evaluate". @param {Card} card */
const leftOf = (card) => card.left.map((line) => line.split(" ")[1]).join(", ");

/** What the import of a card does of its commands. @param {Card} card */
const importWords = (card) =>
  card.left.length
    ? `Import does all of this but what needs you: ${leftOf(card)}.`
    : "Import does all of this, which takes some minutes.";

/**
 * Draw a card into its place. wrong : why something could not be done.
 * @param {HTMLElement} place
 * @param {Card} card
 * @param {any} [wrong]
 */
function draw(place, card, wrong = null) {
  const progress = optional();
  const wait = () => follow(place, card).catch((error) => draw(place, card, error));
  const make = async () => {
    try {
      card.job = await post(pathOf(card.name));
    } catch (error) {
      draw(place, card, error);
      return;
    }
    draw(place, card);
  };
  const going = isGoing(card.job);
  const can = !card.there && !card.missing && !readOnly;
  fill(
    place,
    element(
      "div",
      { className: "card-picture" },
      card.picture
        ? element("img", { src: `${pathOf(card.name)}/picture.jpg`, alt: "", loading: "lazy" })
        : element(
            "span",
            {},
            card.kind === "recipe"
              ? "not rendered yet"
              : card.missing
                ? "footage elsewhere"
                : "not imported yet",
          ),
      !card.there &&
        card.kind === "recipe" &&
        card.picture &&
        element("small", { className: "card-note" }, "a frame of it; not rendered here yet"),
    ),
    element(
      "div",
      { className: "card-words" },
      element("h2", {}, card.title),
      hint(card.there ? placeOf(card) : KINDS[card.kind]),
      element("p", {}, card.words),
      !card.there && card.data && hint(`Data: ${card.data}`),
      !card.there && !going && card.missing && hint(`Cannot be made here yet. ${card.missing}`),
      card.there &&
        card.left.length > 0 &&
        hint(`The import leaves to you: ${leftOf(card)}. The guided set-up leads on.`),
      (!card.there || card.kind === "elsewhere") &&
        card.commands.length > 0 &&
        element(
          "details",
          {},
          element("summary", {}, "Made by these commands"),
          element("pre", { tabIndex: 0 }, card.commands.join("\n")),
        ),
      can && card.kind === "elsewhere" && hint(importWords(card)),
      progress,
      failure(wrong),
    ),
    actions(
      card.there && element("a", { className: "download", href: studioPath(card.session) }, "Open"),
      card.there &&
        !readOnly &&
        element("a", { href: setupPath({ name: card.session }) }, "Guided set-up"),
      can &&
        !going &&
        button(MAKE[card.kind], make, "primary", { ariaLabel: `${MAKE[card.kind]} ${card.title}` }),
      card.guide &&
        element("a", { href: card.guide, target: "_blank", rel: "noopener" }, "How it is made"),
      !card.there &&
        card.kind === "elsewhere" &&
        card.missing &&
        !readOnly &&
        element("a", { href: "/way?new" }, "Begin a session"),
    ),
  );
  place.dataset.card = card.name;
  place.dataset.state = card.there ? "there" : (going && card.job?.state) || card.kind;
  if (going) {
    drawProgress(
      progress,
      progressOf(card.job, "beginning", () => remove(pathOf(card.name)).catch(complain)),
    );
    wait();
  }
}

/** Wait for a card's session; a bundled one is opened at once. */
async function follow(place, card) {
  if (place.followed) return;
  place.followed = true;
  try {
    const job = await followJob(pathOf(card.name), (state) => {
      card.job = state;
      const progress = place.querySelector(".optional");
      if (progress)
        drawProgress(
          progress,
          progressOf(state, "beginning", () => remove(pathOf(card.name)).catch(complain)),
        );
    });
    card.job = job;
    if (job.state !== "done") {
      draw(place, card);
      return;
    }
    if (card.kind === "sample") {
      location.href = studioPath(card.name);
      return;
    }
    const { cards } = await fetchJson("/api/gallery");
    const notes = /** @type {Card["job"]} */ (job)?.notes ?? [];
    draw(
      place,
      cards.find((one) => one.name === card.name) ?? card,
      notes.length
        ? { message: notes.join(" "), hint: "Go on with it in the guided set-up." }
        : null,
    );
  } catch (error) {
    card.job = null;
    draw(place, card, error);
  } finally {
    place.followed = false;
  }
}

async function start() {
  startTheme();
  const content = byId("content");
  const { cards } = await fetchJson("/api/gallery").catch((error) => {
    fill(
      content,
      nothing(
        "The gallery cannot be shown",
        failure(error),
        actions(button("Try again", () => start(), "primary")),
      ),
    );
    throw error;
  });
  if (!cards.length) {
    fill(
      content,
      nothing("The gallery is empty", element("p", {}, "This studio came without samples.")),
    );
    return;
  }
  fill(
    content,
    element(
      "div",
      { className: "gallery-page" },
      pageHead(
        "Gallery",
        "Sessions to open and to track: some come with the studio, some are rendered here, and some tell where their footage is from.",
      ),
      grid,
    ),
  );
  grid.append(
    ...cards.map((card) => {
      const place = element("section", {
        className: "card-box gallery-card",
        ariaLabel: card.title,
      });
      draw(place, card);
      return place;
    }),
  );
}

start().catch(complain);
