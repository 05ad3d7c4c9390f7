// Videos and folders that are dropped on a page from the computer's own windows.

import { element } from "./elements.js";
import { complain } from "./messages.js";

/**
 * The files of a folder that was dropped, with their paths below it.
 * @param {any} entry
 * @returns {Promise<File[]>}
 */
async function filesIn(entry) {
  if (entry.isFile) {
    const file = await new Promise((resolve, reject) => entry.file(resolve, reject));
    const path = entry.fullPath.replace(/^\//, "");
    // As an input for folders says it: the upload goes by it.
    if (path.includes("/")) Object.defineProperty(file, "webkitRelativePath", { value: path });
    return [file];
  }
  const reader = entry.createReader();
  const found = [];
  // A folder's entries come some at a time, until none comes.
  for (;;) {
    const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (!some.length) break;
    for (const one of some) found.push(...(await filesIn(one)));
  }
  return found;
}

/** @param {DataTransfer} data */
async function filesOf(data) {
  const entries = [...data.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
  const found = entries.length ? (await Promise.all(entries.map(filesIn))).flat() : [...data.files];
  // What file managers leave in folders is no footage.
  return found.filter((file) => !/^(\.DS_Store|Thumbs\.db|desktop\.ini)$/i.test(file.name));
}

/**
 * Take files that are dropped anywhere on the page. `words`: said while they are held over it.
 * `take(files)` gets them all; a folder's keep their paths.
 * @param {string} words @param {(files: File[]) => any} take
 */
export function acceptDrops(words, take) {
  const cover = element("div", { className: "drop-cover", hidden: true }, element("p", {}, words));
  document.body.append(cover);
  const isFiles = (event) => [...(event.dataTransfer?.types ?? [])].includes("Files");
  let depth = 0;
  const end = () => {
    depth = 0;
    cover.hidden = true;
  };
  document.addEventListener("dragenter", (event) => {
    if (isFiles(event)) {
      depth += 1;
      cover.hidden = false;
      event.preventDefault();
    }
  });
  document.addEventListener("dragover", (event) => {
    if (isFiles(event)) event.preventDefault();
  });
  document.addEventListener("dragleave", (event) => {
    if (isFiles(event) && --depth <= 0) end();
  });
  document.addEventListener("drop", async (event) => {
    if (!isFiles(event)) return;
    event.preventDefault();
    end();
    try {
      const files = event.dataTransfer ? await filesOf(event.dataTransfer) : [];
      if (files.length) await take(files);
    } catch (error) {
      complain(error);
    }
  });
}
