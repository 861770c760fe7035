// Step 3: the inspection surface: a click, then flood to the creases.

import { put } from "../api.js";
import { button, h } from "../dom.js";
import { facts, fixed, whole } from "../format.js";
import { verdict } from "../status.js";

export const pick = "none";
export const watchesView = true;

export function content(shell) {
  const { part, surface, plan } = shell.project.data;
  if (!part) return verdict("none", "No part yet", "Load one in step Part.");
  const picking = shell.view.state?.pick === "surface";
  shell.view.say(picking ? "Click on the face to inspect" : null);
  const chosen = surface?.seeds?.length;
  return [
    h("p", { class: "soft" }, "The tinted face is inspected. It spreads from the place you click up to the next crease (30°)."),
    facts([
      ["Chosen", h("span", {}, chosen ? "by a click" : "the largest face")],
      plan && !plan.stale && ["Area", whole(plan.surface.area_mm2 / 100), "cm²"], plan && !plan.stale && ["Triangles", whole(plan.surface.triangles)],
      ...(surface?.seeds ?? []).map((s, i) => [`Seed ${i + 1}`, `${fixed(s.x_mm, 2)}  ${fixed(s.y_mm, 2)}  ${fixed(s.z_mm, 2)}`, "mm"]),
    ]),
    h("div", { class: "row" },
      button(picking ? "Stop choosing" : "Choose on the part", () => shell.view.send({ pick: picking ? "none" : "surface" }), { class: picking ? "on" : "", "aria-pressed": String(picking), key: "choose" }),
      button("Take the largest face", () => shell.do(() => put(`${shell.project.path}/surface`, { seeds: [] })), { disabled: !chosen })),
  ];
}

export function leave(shell) { shell.view.say(null); }

export function footer(shell) {
  return button("Continue: key points", () => { location.hash = `#/p/${shell.project.id}/keypoints`; }, { class: "primary", disabled: !shell.project.data.part });
}
