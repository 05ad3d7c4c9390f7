// Uploading files: one after the other, each in one streamed request that goes on where it broke.

import { fetchJson, post, remove } from "./api.js";

const TRIES = 4;
const PAUSE_MILLISECONDS = 1500;

const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

/** How much of a file has arrived, after the connection broke. */
async function arrivedOf(identifier, path) {
  const told = await fetchJson(`/api/uploads/${identifier}`);
  return told.files[path] ?? 0;
}

async function sendFile(identifier, file, path, signal) {
  let offset = 0;
  for (let attempt = 1; ; attempt += 1) {
    let answer;
    try {
      answer = await fetch(`/api/uploads/${identifier}/files?path=${encodeURIComponent(path)}&offset=${offset}`, { method: "PUT", body: offset ? file.slice(offset) : file, signal });
    } catch (cause) {
      if (cause.name === "AbortError" || attempt === TRIES) throw cause.name === "AbortError" ? cause : Object.assign(new Error(`The upload of ${path} broke off.`), { hint: "Look whether the studio still runs, and try again." });
      await pause(PAUSE_MILLISECONDS * attempt);
      offset = await arrivedOf(identifier, path).catch(() => 0);
      continue;
    }
    if (answer.ok) return;
    const told = await answer.json().catch(() => ({}));
    throw Object.assign(new Error(told.message ?? `The upload of ${path} failed.`), { hint: told.hint ?? "" });
  }
}

/** Send files; report(words, share) tells how far. Resolves with the upload's identifier. signal: of an AbortController. */
export async function uploadFiles(files, report, signal = undefined) {
  const { identifier } = await post("/api/uploads");
  const total = [...files].reduce((sum, file) => sum + file.size, 0) || 1;
  let sent = 0;
  try {
    for (const [at, file] of [...files].entries()) {
      report(`Uploading ${Math.round((100 * sent) / total)} %${files.length > 1 ? ` (${at + 1} of ${files.length})` : ""}`, sent / total);
      await sendFile(identifier, file, file.webkitRelativePath || file.name, signal);
      sent += file.size;
    }
  } catch (error) {
    remove(`/api/uploads/${identifier}`).catch(() => {});
    throw error;
  }
  report("Uploaded", 1);
  return identifier;
}
