// Importing a session: a folder of the computer that the studio runs on, or an upload from this browser.

import { post } from "./api.js";
import { openForm } from "./dialogs.js";
import { NAME } from "./elements.js";
import { jobDone, standing } from "./jobs.js";
import { say } from "./messages.js";
import { openSession, refreshSessions } from "./sessions.js";
import { uploadFiles } from "./uploading.js";

/** Open the form. */
export function importForm() {
  openForm({
    heading: "Import footage", action: "Import",
    intro: "A folder with videos/ and calibration/ (optional: masks, background, truth, subject.toml, start_pose.csv), or a bodytrack folder.",
    rows: [
      [{ name: "source", label: "Folder on this computer", placeholder: "full path of the folder" }],
      [{ name: "files", label: "or upload a folder", kind: "file", webkitdirectory: true, multiple: true }],
      [{ name: "name", label: "Session name", ...NAME }, { name: "fps", label: "Frames per second", kind: "number", min: 1, step: "any", hint: "needed for folders of pictures" }],
      [{ name: "refer", kind: "check", label: "use the footage in place instead of copying it" }],
    ],
    send: async (values, report) => {
      const source = values.files.length ? { upload: await uploadFiles(values.files, report) } : { source: values.source };
      const { identifier } = await post("/api/imports", { name: values.name, fps: values.fps ? Number(values.fps) : null, copy: !values.refer, ...source });
      const { warnings } = await jobDone(`/api/imports/${identifier}`, (job) => report(standing(job, "Importing…")));
      await refreshSessions();
      openSession(values.name);
      for (const warning of warnings ?? []) say(warning, { kind: "warning" });
    },
  });
}
