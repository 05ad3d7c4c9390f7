// What the tracking process says reaches the state here, and only here.

import { listen, startEvents } from "./events.js";
import { addLine } from "./studio/log.js";
import { say } from "./messages.js";
import { get, set } from "./state.js";

const RETRY_MILLISECONDS = 1500;
const STRANGER_MILLISECONDS = 15000;

/** @import { Message, MessageOf, MessageType } from "./api_types" */

/** @param {Message} event */
const isHere = (event) => event.session === get("session") && event.run === get("run");

/**
 * Call `handler(event, here)` on every event of a type; here: whether it is of the run that is
 * open.
 * @template {MessageType} T
 * @param {T} type
 * @param {(event: MessageOf<T>, here: boolean) => void} handler
 */
export const onEvent = (type, handler) => listen(type, (event) => handler(event, isHere(event)));

/**
 * Whether the studio that answers here still knows this browser; one that was started anew does
 * not.
 */
async function isKnown() {
  const answer = await fetch("/api/worker").catch(() => null);
  return answer === null || answer.status !== 403;
}

/** Open the socket and keep it open; begun before whatever follows from the state. */
export function startLive() {
  listen("state", (event) => {
    const before = get("work");
    set({ work: event });
    const isSaid =
      before?.state === "failed" && before.run === event.run && before.message === event.message;
    if (event.state === "failed" && !isSaid)
      say(event.message || "The run failed.", { remedy: event.hint, kind: "error" });
  });
  listen("acknowledged", (event) => {
    if (!event.ok) say(event.message, { remedy: event.hint, kind: "error" });
  });
  onEvent("log", (event, here) => here && addLine(event));
  startEvents(
    () => set({ connected: true, stranger: false }),
    async () => {
      set({ connected: false });
      set({ stranger: !(await isKnown()) });
      return get("stranger") ? STRANGER_MILLISECONDS : RETRY_MILLISECONDS;
    },
  );
}
