// Uploading files: one after the other, piece by piece, so that it can be said how far it is; a
// piece that breaks goes on where it broke.

import { accepted, fault, fetchJson, post, remove } from "./api.js";
import { dotted } from "./elements.js";
import { timeLeft } from "./jobs.js";

const PIECE = 16 << 20;
const TRIES = 4;
const PAUSE_MILLISECONDS = 1500;

const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
const megabytes = (bytes) => (bytes < 1e8 ? (bytes / 1e6).toFixed(1) : Math.round(bytes / 1e6));

/** How much of a file has arrived, after the connection broke. */
async function arrivedOf(identifier, path) {
  return (await fetchJson(`/api/uploads/${identifier}`)).files[path] ?? 0;
}

/** Send a file; `arrived(bytes)` says how much of it is there. */
async function sendFile(identifier, file, path, arrived, signal) {
  let offset = 0;
  let failures = 0;
  for (;;) {
    let answer;
    try {
      answer = await fetch(
        `/api/uploads/${identifier}/files?path=${encodeURIComponent(path)}&offset=${offset}`,
        { method: "PUT", body: file.slice(offset, offset + PIECE), signal },
      );
    } catch (cause) {
      failures += 1;
      if (cause.name === "AbortError") throw cause;
      if (failures === TRIES)
        throw fault(
          `The upload of ${path} broke off.`,
          "Check whether the studio still runs, and try again.",
        );
      await pause(PAUSE_MILLISECONDS * failures);
      offset = await arrivedOf(identifier, path).catch(() => 0);
      continue;
    }
    failures = 0;
    offset = (await (await accepted(answer)).json()).received;
    arrived(offset);
    if (offset >= file.size) return;
  }
}

/**
 * Send files; report(words, share) says how far. Resolves with the upload's identifier.
 * @param {ArrayLike<File>} files
 * @param {(words: string, share: number) => void} report
 * @param {AbortSignal} [signal]
 */
export async function uploadFiles(files, report, signal) {
  const { identifier } = await post("/api/uploads");
  const total = Array.from(files).reduce((sum, file) => sum + file.size, 0) || 1;
  const begun = performance.now();
  let sent = 0;
  const reach = (at, bytes) => {
    const left = bytes ? ((performance.now() - begun) * (total - bytes)) / bytes / 1000 : 0;
    report(
      dotted(
        `Uploading ${Math.round((100 * bytes) / total)} % of ${megabytes(total)} MB`,
        files.length > 1 && `file ${at + 1} of ${files.length}`,
        timeLeft(left),
      ),
      bytes / total,
    );
  };
  try {
    for (const [at, file] of Array.from(files).entries()) {
      reach(at, sent);
      await sendFile(
        identifier,
        file,
        file.webkitRelativePath || file.name,
        (bytes) => reach(at, sent + bytes),
        signal,
      );
      sent += file.size;
    }
  } catch (error) {
    remove(`/api/uploads/${identifier}`).catch(() => {});
    throw error;
  }
  report("Uploaded", 1);
  return identifier;
}
