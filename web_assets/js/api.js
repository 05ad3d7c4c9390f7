// The JSON API. Errors carry the server's cause and remedy; every call names the window, whose
// scene it may concern. The types of requests and answers come from the API's own description
// (api_types.d.ts).

import { windowName } from "./window.js";

/** @import { Address, Answer, Body } from "./api_types" */

/** An error with a remedy. */
export const fault = (message, hint = "", more = {}) =>
  Object.assign(new Error(message), { hint, ...more });

/** An answer, or the error that it carries. */
export async function accepted(answer) {
  if (answer.ok) return answer;
  const { message = `The studio answered ${answer.status}.`, hint = "" } = await answer
    .json()
    .catch(() => ({}));
  throw fault(message, hint, { status: answer.status });
}

/**
 * Whether this browser may only look: what changes something is refused, and the page does not
 * offer it.
 */
export const readOnly = document.documentElement.dataset.access === "view";
const LOOKING = ["show", "view", "play-layers", "camera", "point"].map(
  (what) => `/api/scene/${what}`,
);

/** @param {string} method @param {string} path @param {any} [body] @param {RequestInit} [options] */
async function call(method, path, body = undefined, options = {}) {
  if (readOnly && method !== "GET" && !LOOKING.includes(path))
    throw fault(
      "This address is for looking: it changes nothing.",
      "Ask whoever started the studio for the other address that it printed.",
    );
  /** @type {RequestInit} */
  const request = {
    method,
    headers: {
      "x-studio-window": windowName,
      ...(body === undefined ? {} : { "content-type": "application/json" }),
    },
    ...options,
  };
  if (body !== undefined) request.body = JSON.stringify(body);
  const answer = await fetch(path, request).catch((cause) => {
    throw cause.name === "AbortError"
      ? cause
      : fault("The studio does not answer.", "Check in its terminal whether it still runs.");
  });
  const kind = (await accepted(answer)).headers.get("content-type") ?? "";
  const text = await answer.text();
  return kind.includes("json") && text ? JSON.parse(text) : text;
}

/**
 * @type {<const P extends string>(path: Address<P, "get">, options?: RequestInit) =>
 *   Promise<Answer<P, "get">>}
 */
export const fetchJson = (path, options) => call("GET", path, undefined, options);
/**
 * @type {<const P extends string>(path: Address<P, "post">, body?: Body<P, "post">) =>
 *   Promise<Answer<P, "post">>}
 */
export const post = (path, body) => call("POST", path, body ?? {});
/**
 * @type {<const P extends string>(path: Address<P, "put">, body: Body<P, "put">) =>
 *   Promise<Answer<P, "put">>}
 */
export const put = (path, body) => call("PUT", path, body);
/**
 * @type {<const P extends string>(path: Address<P, "patch">, body: Body<P, "patch">) =>
 *   Promise<Answer<P, "patch">>}
 */
export const patch = (path, body) => call("PATCH", path, body, { keepalive: true }); // also when the page is left at once
/** @type {<const P extends string>(path: Address<P, "delete">) => Promise<Answer<P, "delete">>} */
export const remove = (path) => call("DELETE", path);
/** Send raw bytes. */
export const putBytes = (path, bytes) => call("PUT", path, undefined, { body: bytes });

/** @returns {`/api/sessions/${string}`} */
export const sessionPath = (session) => `/api/sessions/${encodeURIComponent(session)}`;
/** @returns {`/api/sessions/${string}/runs/${string}`} */
export const runPath = (session, run) =>
  `/api/sessions/${encodeURIComponent(session)}/runs/${encodeURIComponent(run)}`;
/**
 * A view's numbers of a whole run.
 * @returns {`/api/sessions/${string}/runs/${string}/views/${string}`}
 */
export const runView = (session, run, view, query = "") =>
  `${runPath(session, run)}/views/${view}${query && `?${query}`}`;
/**
 * A view's numbers of a frame.
 * @returns {`/api/sessions/${string}/runs/${string}/frames/${string}/views/${string}`}
 */
export const frameView = (session, run, frame, view, query = "") =>
  `${runPath(session, run)}/frames/${frame}/views/${view}${query && `?${query}`}`;
