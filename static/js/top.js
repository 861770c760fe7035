// The top bar: whose project, which part, who looks, what runs.

import { del } from "./api.js";
import { button, fill, h } from "./dom.js";
import { sizes } from "./format.js";

const KINDS = { plan: "Planning", suggest: "Choosing key points", simulate: "Rehearsing", alignment: "Aligning", assessment: "Assessing" };

/** Draw the top bar. */
export function drawTop(node, project, rename) {
  const { part, people, jobs } = project.data;
  const running = [...jobs.values()].filter((j) => ["queued", "running"].includes(j.state));
  fill(node,
    h("a", { class: "brand", href: "#/", title: "All projects" }, h("img", { src: "static/icon.svg", alt: "" }), "EchoBase"),
    h("button", { type: "button", class: "btn ghost project", title: "Rename", onclick: rename, data: { key: "rename" } }, project.data.project?.name ?? "…"),
    part && h("span", { class: "part" }, `${part.name}   `, h("span", { class: "num" }, sizes(part.extents_mm)), part.unit !== "mm" && ` (file in ${part.unit})`),
    h("span", { class: "grow" }),
    h("span", { class: "jobs" }, running.map((job) => h("span", { class: "job" },
      h("span", { class: "what", title: job.text ?? "" }, job.text || KINDS[job.kind] || job.kind),
      h("progress", { value: job.fraction ?? 0, max: 1, "aria-label": KINDS[job.kind] ?? "job" }),
      button("Cancel", () => del(`/jobs/${job.id}`).catch(() => {}), { class: "tiny ghost", key: `cancel-${job.id}` })))),
    project.online
      ? h("span", { class: "people", title: (people.names ?? []).join(", ") }, people.clients > 1 ? `${people.clients} views open` : "connected")
      : h("span", { class: "people off", role: "alert" }, "no connection, trying again"));
}
