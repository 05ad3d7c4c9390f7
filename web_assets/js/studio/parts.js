// Small components that pages share: a button that waits for what it does, an error with its
// remedy, a bar of progress, a box to be checked, a choice, a table.

import { html, useState } from "./component.js";

/**
 * A button that cannot be pressed again while what it does is being done.
 * @param {{ act: () => any, kind?: string, disabled?: boolean, children?: any, [more: string]: any }} properties
 */
export function Action({ act, kind = "", disabled = false, children, ...more }) {
  const [isBusy, setBusy] = useState(false);
  const press = async () => {
    setBusy(true);
    try {
      await act();
    } finally {
      setBusy(false);
    }
  };
  return html`<button
    type="button"
    class=${kind}
    disabled=${isBusy || disabled}
    onClick=${press}
    ...${more}
  >
    ${children}
  </button>`;
}

/** An error with its remedy. @param {{ error: { message: string, hint?: string } | null }} properties */
export const Failure = ({ error }) =>
  error &&
  html`<p class="wrong" role="alert">
    ${error.message}${error.hint && html`<span class="hint"> ${error.hint}</span>`}
  </p>`;

/**
 * How far something is, in words and as a bar, and what cancels it; as `progressOf` says it.
 * @param {{ words: string, share: number | null, cancel?: () => void }} properties
 */
export const Progress = ({ words, share, cancel }) => html`<div class="step-progress">
  <p class="hint" role="status">${words}</p>
  <div class="long-progress"><i style=${{ width: `${Math.round(100 * (share ?? 0))}%` }}></i></div>
  ${
    cancel &&
    html`<div class="step-actions"><${Action} kind="quiet small" act=${cancel}>Cancel</${Action}></div>`
  }
</div>`;

/**
 * A box to be checked before its label; `take(checked)` hears of it.
 * @param {{ checked: boolean, take: (checked: boolean) => void, title?: string, children?: any }} properties
 */
export const Check = ({ checked, take, title = "", children }) => html`
  <label class="check" title=${title}>
    <input type="checkbox" checked=${checked} onChange=${({ target }) => take(target.checked)} />
    ${children}
  </label>
`;

/**
 * A choice, under its label if it has one; `take(value)` hears of it.
 * @param {{ options: ([string, string] | string)[], value?: string, take?: (value: string) => void,
 *   label?: string, title?: string, [more: string]: any }} properties `options`: values with their
 *   words, or words alone
 */
export function Select({ options, value, take, label = "", title = "", ...more }) {
  const made = html`<select
    aria-label=${label || null}
    value=${take && value}
    title=${label ? "" : title}
    onChange=${({ target }) => take?.(target.value)}
    ...${more}
  >
    ${options.map((one) => {
      const [own, words] = Array.isArray(one) ? one : [one, one];
      return html`<option key=${own} value=${own} selected=${own === value}>${words}</option>`;
    })}
  </select>`;
  return label ? html`<label title=${title}>${label}${made}</label>` : made;
}

/** A small button that stays pressed. */
export const Toggle = (/** @type {any} */ { isOn, act, children }) => html`
  <button type="button" class="toggle small" aria-pressed=${String(isOn)} onClick=${() => act()}>
    ${children}
  </button>
`;

/** @param {{ heads: string[], rows: any[][], kind?: string }} properties */
export const Table = ({ heads, rows, kind = "figures" }) => html`<table class=${kind}>
  <thead>
    <tr>${heads.map((head) => html`<th>${head}</th>`)}</tr>
  </thead>
  <tbody>
    ${rows.map((cells) => html`<tr>${cells.map((cell) => html`<td>${cell}</td>`)}</tr>`)}
  </tbody>
</table>`;
