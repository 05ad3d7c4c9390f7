// Uploading files: one after the other, each in one streamed request.

import { post } from "./api.js";

/** Send files; report(words) tells how far. Resolves with the upload's identifier. */
export async function uploadFiles(files, report) {
  const { identifier } = await post("/api/uploads");
  const total = [...files].reduce((sum, file) => sum + file.size, 0) || 1;
  let sent = 0;
  for (const file of files) {
    const path = file.webkitRelativePath || file.name;
    const answer = await fetch(`/api/uploads/${identifier}/files?path=${encodeURIComponent(path)}`, { method: "PUT", body: file });
    if (!answer.ok) {
      const told = await answer.json().catch(() => ({}));
      throw Object.assign(new Error(told.message ?? `The upload of ${path} failed.`), { hint: told.hint ?? "" });
    }
    sent += file.size;
    report(`Uploading ${Math.round((100 * sent) / total)} %`);
  }
  return identifier;
}
