// Importing a session: a folder of the computer that the studio runs on, or an upload from this browser.

import { post } from "./api.js";
import { openForm } from "./studio/dialogs.js";
import { NAME } from "./elements.js";
import { jobDone, standing } from "./jobs.js";
import { say } from "./messages.js";
import { openSession, refreshSessions } from "./sessions.js";
import { uploadFiles } from "./uploading.js";

/** What dropped files are called as a session: their folder's name, else that of the only file. */
function nameOf(files) {
  const [first] = files;
  const name = first.webkitRelativePath ? first.webkitRelativePath.split("/")[0] : files.length === 1 ? first.name.replace(/\.[^.]*$/, "") : "take";
  return name.replace(/[^A-Za-z0-9_-]+/g, "-").slice(0, 64);
}

const countOf = (files) => `${files.length} ${files.length === 1 ? "file" : "files"}, ${(files.reduce((sum, file) => sum + file.size, 0) / 1e6).toFixed(1)} MB`;

/** Open the form. `dropped`: files to be imported, from the computer's own windows. @param {File[] | null} [dropped] */
export function importForm(dropped = null) {
  openForm({
    heading: "Import footage", action: "Import",
    intro: dropped ? `${countOf(dropped)} were dropped: ${dropped.slice(0, 4).map((file) => file.name).join(", ")}${dropped.length > 4 ? " …" : ""}.` : "A folder with videos/ and calibration/ (optional: masks, background, truth, subject.toml, start_pose.csv), or a bodytrack folder.",
    rows: [
      ...(dropped ? [] : [[{ name: "source", label: "Folder on this computer", placeholder: "full path of the folder" }],
        [{ name: "files", label: "or upload a folder", kind: "file", webkitdirectory: true, multiple: true }]]),
      [{ name: "name", label: "Session name", value: dropped ? nameOf(dropped) : "", ...NAME }, { name: "fps", label: "Frames per second", kind: "number", min: 1, step: "any", hint: "needed for folders of pictures" }],
      ...(dropped ? [] : [[{ name: "refer", kind: "check", label: "use the footage in place instead of copying it" }]]),
    ],
    send: async (values, report) => {
      const source = dropped ? { upload: await uploadFiles(dropped, report) } : values.files.length ? { upload: await uploadFiles(values.files, report) } : { source: values.source };
      const { identifier } = await post("/api/imports", { name: values.name, fps: values.fps ? Number(values.fps) : null, copy: !values.refer, ...source });
      const { warnings } = await jobDone(`/api/imports/${identifier}`, (job) => report(standing(job, "Importing…")));
      await refreshSessions();
      openSession(values.name);
      for (const warning of warnings ?? []) say(warning, { kind: "warning" });
    },
  });
}
