// The top bar: whose project, which part, who looks, what runs.

import { del } from "./api.js";
import { askText } from "./dialog.js";
import { button, fill, h } from "./dom.js";
import { sizes } from "./format.js";

const KINDS = { plan: "Planning", suggest: "Choosing key points", simulate: "Rehearsing", alignment: "Aligning", assessment: "Assessing" };

/** Who looks at this project. */
function who(people) {
  const names = (people.names ?? []).join(", ");
  return people.clients > 1 ? `${people.clients} views open${names ? `: ${names}` : ""}` : names || "connected";
}

/** Ask for a name; it travels as a cookie, so that the others see who picks. */
async function name() {
  const given = await askText("Your name", "Shown to those who look at the same project", /echobase-name=([^;]*)/.exec(document.cookie)?.[1] ?? "", "Save");
  if (given) document.cookie = `echobase-name=${given.replace(/[^\x20-\x7e]|[;,"\\]/g, "")}; path=/; max-age=31536000; SameSite=Strict`;
}

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
      ? h("button", { type: "button", class: "btn ghost people", title: "Your name, for the others", onclick: name, data: { key: "people" } }, who(people))
      : h("span", { class: "people off", role: "alert" }, "no connection, trying again"));
}
