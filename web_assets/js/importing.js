// Importing a session: a folder of the computer that the studio runs on, or an upload from this browser.

import { fetchJson, post } from "./api.js";
import { openForm } from "./dialogs.js";
import { say } from "./messages.js";
import { openSession, refreshSessions } from "./rail.js";

const POLL_MILLISECONDS = 400;

/** Wait for an import to end, telling its progress; throws its error. */
async function watchImport(identifier, report) {
  for (;;) {
    const told = await fetchJson(`/api/imports/${identifier}`);
    if (told.state === "failed") throw Object.assign(new Error(told.message), { hint: told.hint });
    if (told.state === "done") return told;
    report(told.total ? `${told.step} ${Math.round((100 * told.done) / told.total)} %` : told.step || "Importing…");
    await new Promise((resolve) => setTimeout(resolve, POLL_MILLISECONDS));
  }
}

/** Send files one by one, each in one streamed request; returns the upload's identifier. */
async function upload(files, report) {
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

/** Open the form. */
export function importForm() {
  openForm({
    heading: "Import footage", action: "Import",
    intro: "A folder with videos/ and calibration/ (masks, background, truth, subject.toml, start_pose.csv if there are), or a bodytrack folder.",
    rows: [
      [{ name: "source", label: "Folder on this computer", placeholder: "full path of the folder" }],
      [{ name: "files", label: "or upload a folder", kind: "file", webkitdirectory: true, multiple: true }],
      [{ name: "name", label: "Session name", required: true, pattern: "[A-Za-z0-9_\\-]{1,64}", title: "Letters, digits, - and _, up to 64" },
        { name: "fps", label: "Frames per second", kind: "number", min: 1, step: "any", hint: "needed for folders of pictures" }],
      [{ name: "refer", kind: "check", label: "refer to the footage where it lies instead of copying it" }],
    ],
    send: async (values, report) => {
      const body = { name: values.name, fps: values.fps ? Number(values.fps) : null, copy: !values.refer };
      if (values.files.length) body.upload = await upload(values.files, report);
      else body.source = values.source;
      const { identifier } = await post("/api/imports", body);
      const told = await watchImport(identifier, report);
      await refreshSessions();
      openSession(values.name);
      for (const warning of told.warnings ?? []) say(warning, { kind: "warning" });
    },
  });
}
