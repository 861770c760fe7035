// The first page: start with a sample, with your own part, or go on with a project.

import { ApiError, del, get, post, upload } from "./api.js";
import { askText, confirm } from "./dialog.js";
import { button, fill, h } from "./dom.js";
import { issueList } from "./status.js";

/** Draw the list of projects. */
export async function drawStart(root) {
  document.title = "EchoBase";
  const problems = h("div");
  const list = h("div", {}, h("p", { class: "faint" }, "Loading…"));
  const attempt = async (action) => {
    fill(problems);
    try { return await action(); } catch (error) {
      if (!(error instanceof ApiError)) throw error;
      fill(problems, issueList(error.issues));
      return null;
    }
  };
  const open = (id, step = "part") => { location.hash = `#/p/${id}/${step}`; };
  const sample = (name, title) => attempt(async () => {
    const project = await post("/projects", { name: title, sample: name });
    open(project.id);
  });
  const own = async () => {
    const name = await askText("New project", "Name", "", "Create");
    if (name) await attempt(async () => open((await post("/projects", { name })).id));
  };
  const archive = h("input", { type: "file", accept: ".zip", class: "hidden", onchange: () => archive.files[0] && attempt(async () => {
    const project = await upload("POST", "/projects/import", [["file", archive.files[0]]]).promise;
    open(project.id);
  }) });
  const card = (title, text, action) => h("section", { class: "card" }, h("div", { class: "stack" }, h("h2", {}, title), h("p", {}, text)), action);
  fill(root, h("div", { class: "start" },
    h("header", {}, h("h1", {}, "EchoBase"), h("p", { class: "lead" }, "Plan a robotic ultrasonic inspection from CAD, find the real part with a short alignment scan, and download the corrected KRL program.")),
    problems,
    h("div", { class: "cards" },
      card("Aerofoil", "A curved skin of about 1.5 m. Plan, rehearse with the simulated scanner, align, download.", button("Try the aerofoil", () => sample("aerofoil", "Aerofoil sample"), { class: "primary" })),
      card("Flat plate", "150 × 100 × 10 mm. Shows what a flat face can tell and what only its edges can.", button("Try the flat plate", () => sample("flat-plate", "Flat plate sample"), { class: "primary" })),
      card("Your part", "STEP, STL, OBJ, PLY or GLB, and the cell it stands in.", h("div", { class: "stack" }, button("New project", own, { class: "primary" }), button("Open an archive", () => archive.click()), archive))),
    h("section", { class: "stack" }, h("h3", {}, "Projects"), list)));
  const draw = async () => {
    const projects = await attempt(() => get("/projects"));
    if (!projects) { fill(list); return; }
    if (!projects.length) { fill(list, h("p", { class: "faint" }, "None yet.")); return; }
    const newest = [...projects].sort((a, b) => String(b.changed).localeCompare(String(a.changed)));
    fill(list, h("table", {}, h("tbody", {}, newest.map((p) => h("tr", {},
      h("td", {}, h("a", { href: `#/p/${p.id}/part` }, p.name)), h("td", { class: "l faint" }, when(p.changed)),
      h("td", {}, button("Delete", async () => {
        if (await confirm(`Delete ${p.name}?`, "Its part, scans and results are removed. An archive made before stays usable.", "Delete")) { await attempt(() => del(`/projects/${p.id}`)); await draw(); }
      }, { class: "ghost tiny", key: `delete-${p.id}` })))))));
  };
  await draw();
}

function when(text) {
  const date = new Date(text);
  return Number.isNaN(date.getTime()) ? "" : date.toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" });
}

