// A drawing of a report, as it stands there.

import { API } from "../api.js";
import { fill, h } from "../dom.js";

/** Show the drawing at a REST address; says so if there is none. */
export async function drawing(body, alive, path) {
  const answer = await fetch(`${API}${path}`, { credentials: "same-origin" });
  if (!answer.ok) throw new Error((await answer.json().catch(() => null))?.error?.message ?? "There is no such drawing.");
  const text = await answer.text();
  if (!alive()) return;
  const source = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
  fill(body, h("div", { class: "figure" }, h("img", { src: source, alt: "", onload: () => URL.revokeObjectURL(source) })));
}
