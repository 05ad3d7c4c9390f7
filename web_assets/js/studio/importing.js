// Importing a session: a folder of the computer that the studio runs on, or an upload from this
// browser.

import { post } from "../api.js";
import { NAME } from "../elements.js";
import { jobDone, standing } from "../jobs.js";
import { say } from "../messages.js";
import { openSession, refreshSessions } from "../sessions.js";
import { uploadFiles } from "../uploading.js";
import { openForm } from "./dialogs.js";

const MOST_NAMED = 4;
const WHAT =
  "A folder with videos/ and calibration/ (optional: masks, background, truth, subject.toml, " +
  "start_pose.csv), or a bodytrack folder.";

/**
 * What dropped files are called as a session: their folder's name, else that of the only file.
 * @param {File[]} files
 */
function nameOf(files) {
  const [{ webkitRelativePath: path, name }] = files;
  const alone = files.length === 1 ? name.replace(/\.[^.]*$/, "") : "take";
  const own = path ? path.split("/")[0] : alone;
  return own.replace(/[^A-Za-z0-9_-]+/g, "-").slice(0, 64);
}

/** How many files were dropped, how large, and the first of their names. @param {File[]} files */
function droppedWords(files) {
  const megabytes = (files.reduce((sum, file) => sum + file.size, 0) / 1e6).toFixed(1);
  const count = `${files.length} ${files.length === 1 ? "file" : "files"}, ${megabytes} MB`;
  const names = files.slice(0, MOST_NAMED).map((file) => file.name);
  return `${count} were dropped: ${names.join(", ")}${files.length > MOST_NAMED ? " …" : ""}.`;
}

/** Where the footage comes from: fields that a form with dropped files does not need. */
const SOURCES = [
  [{ name: "source", label: "Folder on this computer", placeholder: "full path of the folder" }],
  [
    {
      name: "files",
      label: "or upload a folder",
      kind: "file",
      webkitdirectory: true,
      multiple: true,
    },
  ],
];
const REFER = [
  [{ name: "refer", kind: "check", label: "use the footage in place instead of copying it" }],
];

/**
 * Open the form. `dropped`: files to be imported, from the computer's own windows.
 * @param {File[] | null} [dropped]
 */
export function importForm(dropped = null) {
  const name = { name: "name", label: "Session name", value: dropped ? nameOf(dropped) : "" };
  const fps = {
    name: "fps",
    label: "Frames per second",
    kind: "number",
    min: 1,
    step: "any",
    hint: "needed for folders of pictures",
  };
  openForm({
    heading: "Import footage",
    action: "Import",
    intro: dropped ? droppedWords(dropped) : WHAT,
    rows: [...(dropped ? [] : SOURCES), [{ ...name, ...NAME }, fps], ...(dropped ? [] : REFER)],
    send: async (values, report) => {
      const files = dropped ?? values.files;
      const source = files.length
        ? { upload: await uploadFiles(files, report) }
        : { source: values.source };
      const { identifier } = await post("/api/imports", {
        name: values.name,
        fps: values.fps ? Number(values.fps) : null,
        copy: !values.refer,
        ...source,
      });
      const { warnings } = await jobDone(`/api/imports/${identifier}`, (job) =>
        report(standing(job, "Importing…")),
      );
      await refreshSessions();
      openSession(values.name);
      for (const warning of warnings ?? []) say(warning, { kind: "warning" });
    },
  });
}
