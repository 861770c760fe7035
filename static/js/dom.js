// Elements without markup: every string becomes text, never HTML, so names and messages are data.

const PROPERTIES = new Set(["value", "checked", "disabled", "hidden", "open", "selected", "indeterminate", "htmlFor", "textContent"]);

/** Make an element. Props: `class`, `on*` listeners, `data`, properties and attributes; null and false are left out. */
export function h(tag, props = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(props ?? {})) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (name === "class") node.className = value;
    else if (name === "data") Object.assign(node.dataset, value);
    else if (name === "style") Object.assign(node.style, value);
    else if (PROPERTIES.has(name)) node[name] = value;
    else node.setAttribute(name, value === true ? "" : String(value));
  }
  append(node, children);
  return node;
}

/** Append children: nodes, strings, numbers, or arrays of them; null, undefined and false are left out. */
export function append(node, children) {
  for (const child of children.flat(Infinity)) {
    if (child === null || child === undefined || child === false) continue;
    node.append(child instanceof Node ? child : String(child));
  }
  return node;
}

/** Replace what is in a node. */
export function fill(node, ...children) {
  node.replaceChildren();
  return append(node, children);
}

/** Keep the focus and the scroll position of a region while it is drawn again. */
export function redraw(node, make) {
  const active = node.contains(document.activeElement) ? document.activeElement : null;
  const key = active?.dataset?.key ?? active?.name ?? null;
  const scroll = node.scrollTop;
  fill(node, make());
  node.scrollTop = scroll;
  if (key) [...node.querySelectorAll("[data-key],[name]")].find((n) => (n.dataset.key ?? n.name) === key)?.focus({ preventScroll: true });
}

/** A button. */
export function button(text, onclick, props = {}) {
  return h("button", { type: "button", ...props, class: `btn ${props.class ?? ""}`, onclick, data: { key: props.key ?? text } }, text);
}

let counter = 0;
/** A new id for a label. */
export const uid = (stem) => `${stem}-${++counter}`;
