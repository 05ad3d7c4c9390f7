// Uploading files: one after the other, piece by piece, so that it can be said how far it is; a piece that breaks goes on
// where it broke.

import { fetchJson, post, remove } from "./api.js";
import { duration } from "./elements.js";

const PIECE = 16 << 20;
const TRIES = 4;
const PAUSE_MILLISECONDS = 1500;
const WORTH_TELLING = 2;

const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
const megabytes = (bytes) => (bytes < 1e8 ? (bytes / 1e6).toFixed(1) : Math.round(bytes / 1e6));

/** How much of a file has arrived, after the connection broke. */
async function arrivedOf(identifier, path) {
  const told = await fetchJson(`/api/uploads/${identifier}`);
  return told.files[path] ?? 0;
}

/** Send a file; `arrived(bytes)` tells how much of it is there. */
async function sendFile(identifier, file, path, arrived, signal) {
  let offset = 0;
  let failures = 0;
  for (;;) {
    let answer;
    try {
      answer = await fetch(`/api/uploads/${identifier}/files?path=${encodeURIComponent(path)}&offset=${offset}`, { method: "PUT", body: file.slice(offset, offset + PIECE), signal });
    } catch (cause) {
      failures += 1;
      if (cause.name === "AbortError") throw cause;
      if (failures === TRIES) throw Object.assign(new Error(`The upload of ${path} broke off.`), { hint: "Look whether the studio still runs, and try again." });
      await pause(PAUSE_MILLISECONDS * failures);
      offset = await arrivedOf(identifier, path).catch(() => 0);
      continue;
    }
    const told = await answer.json().catch(() => ({}));
    if (!answer.ok) throw Object.assign(new Error(told.message ?? `The upload of ${path} failed.`), { hint: told.hint ?? "" });
    failures = 0;
    offset = told.received;
    arrived(offset);
    if (offset >= file.size) return;
  }
}

/** Send files; report(words, share) tells how far. Resolves with the upload's identifier. signal: of an AbortController. */
export async function uploadFiles(files, report, signal = undefined) {
  const { identifier } = await post("/api/uploads");
  const total = [...files].reduce((sum, file) => sum + file.size, 0) || 1;
  const begun = performance.now();
  let sent = 0;
  const tell = (at, bytes) => {
    const seconds = (performance.now() - begun) / 1000;
    const left = bytes ? (seconds * (total - bytes)) / bytes : 0;
    const words = [`Uploading ${Math.round((100 * bytes) / total)} % of ${megabytes(total)} MB`, files.length > 1 ? `file ${at + 1} of ${files.length}` : "", left > WORTH_TELLING ? `${duration(left)} left` : ""];
    report(words.filter(Boolean).join(" · "), bytes / total);
  };
  try {
    for (const [at, file] of [...files].entries()) {
      tell(at, sent);
      await sendFile(identifier, file, file.webkitRelativePath || file.name, (bytes) => tell(at, sent + bytes), signal);
      sent += file.size;
    }
  } catch (error) {
    remove(`/api/uploads/${identifier}`).catch(() => {});
    throw error;
  }
  report("Uploaded", 1);
  return identifier;
}
