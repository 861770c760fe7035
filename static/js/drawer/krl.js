// Programs as text: the very files of the download, read from the zip.

import { API } from "../api.js";
import { fill, h } from "../dom.js";
import { bytes } from "../format.js";
import { readZip } from "../zip.js";

const MOST = 400_000;

/** Show the files of a program zip. */
export async function programs(body, alive, path) {
  const answer = await fetch(`${API}${path}`, { credentials: "same-origin" });
  if (!answer.ok) throw new Error((await answer.json().catch(() => null))?.error?.message ?? "There is no such program.");
  const files = (await readZip(await answer.blob())).filter((f) => /\.(src|dat|txt|json|csv|md)$/i.test(f.name));
  if (!alive()) return;
  const text = h("pre", { tabindex: "0", "aria-label": "Program text" });
  const list = h("div", { class: "files" });
  const show = async (file) => {
    for (const b of list.children) b.classList.toggle("on", b.dataset.name === file.name);
    const content = await file.text();
    text.textContent = content.length > MOST ? `${content.slice(0, MOST)}\n… (${bytes(content.length - MOST)} more in the download)` : content;
  };
  fill(list, files.map((f) => h("button", { type: "button", data: { name: f.name }, title: `${f.name}, ${bytes(f.size)}`, onclick: () => show(f) }, f.name)));
  fill(body, h("div", { class: "krl" }, list, text));
  const first = files.find((f) => /\.src$/i.test(f.name)) ?? files[0];
  if (first) await show(first);
}
