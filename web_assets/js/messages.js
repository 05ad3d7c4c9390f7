// Messages that pass: a cause and a remedy, never a traceback.

const box = document.getElementById("toasts");
const SECONDS_SHOWN = 9;

/** Show a message; errors stay until closed. */
export function say(text, { remedy = "", kind = "info" } = {}) {
  const toast = document.createElement("div");
  toast.className = `toast ${kind}`;
  const cause = document.createElement("p");
  cause.textContent = text;
  const close = document.createElement("button");
  close.className = "icon quiet small";
  close.textContent = "×";
  close.setAttribute("aria-label", "Close message");
  close.onclick = () => toast.remove();
  toast.append(cause, close);
  if (remedy) {
    const line = document.createElement("p");
    line.className = "remedy";
    line.textContent = remedy;
    toast.append(line);
  }
  box.append(toast);
  while (box.children.length > 4) box.firstChild.remove();
  if (kind !== "error") setTimeout(() => toast.remove(), SECONDS_SHOWN * 1000);
}

/** Show an error of the API (or of the network) in its own words. */
export function complain(error) {
  if (error.name === "AbortError") return;
  say(error.message || "Something went wrong.", { remedy: error.hint ?? "", kind: "error" });
}
