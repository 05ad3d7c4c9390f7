// The JSON API. Errors carry the server's cause and remedy; every call names the window, whose scene it may concern.

import { windowName } from "./window.js";

async function call(method, path, body, options = {}) {
  const request = { method, headers: { "x-studio-window": windowName }, ...options };
  if (body !== undefined) {
    request.body = JSON.stringify(body);
    request.headers["content-type"] = "application/json";
  }
  let answer;
  try {
    answer = await fetch(path, request);
  } catch (cause) {
    if (cause.name === "AbortError") throw cause;
    throw Object.assign(new Error("The studio does not answer."), { hint: "Look whether it still runs in its terminal." });
  }
  if (!answer.ok) {
    const told = await answer.json().catch(() => ({}));
    throw Object.assign(new Error(told.message ?? `The studio answered ${answer.status}.`), { hint: told.hint ?? "", status: answer.status });
  }
  const kind = answer.headers.get("content-type") ?? "";
  const text = await answer.text();
  return kind.includes("json") && text ? JSON.parse(text) : text;
}

export const fetchJson = (path, options) => call("GET", path, undefined, options);
export const post = (path, body = {}) => call("POST", path, body);
export const put = (path, body) => (body instanceof Blob || typeof body === "string" ? call("PUT", path, undefined, { body }) : call("PUT", path, body));
export const patch = (path, body) => call("PATCH", path, body);
export const remove = (path) => call("DELETE", path);

export const runPath = (session, run) => `/api/sessions/${encodeURIComponent(session)}/runs/${encodeURIComponent(run)}`;
export const sessionPath = (session) => `/api/sessions/${encodeURIComponent(session)}`;
