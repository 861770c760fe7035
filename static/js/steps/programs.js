// Step 6: the KRL of both paths: proven, readable, ready to download.

import { href } from "../api.js";
import { h } from "../dom.js";
import { programs as krl } from "../drawer/krl.js";
import { bytes, facts, fixed, whole } from "../format.js";
import { issueList, verdict, working } from "../status.js";

export const KINDS = [["alignment", "Alignment scan"], ["inspection", "Inspection"]];

export const watchesJobs = true;

export function content(shell) {
  const { plan } = shell.project.data;
  if (shell.busy("plan")) return working(shell, "Planning", "plan");
  if (!plan) return verdict("none", "No programs yet", "Plan the paths first.");
  return [KINDS.map(([kind, title]) => program(shell, kind, title, plan.programs?.[kind], plan[kind]?.program)),
    h("p", { class: "soft small" }, "Dry-run every program in T1 before you let it run by itself.")];
}

/** One program: verdict, proof, download. */
export function program(shell, kind, title, state, manifest) {
  const free = state?.available;
  return h("section", { class: "stack" }, h("h3", {}, title),
    free ? verdict("good", "Proven", "Read back from its own text and compared pose by pose.") : [verdict("bad", "Withheld"), issueList(state?.error?.issues ?? (state?.error ? [{ severity: "error", ...state.error }] : []), 4)],
    manifest && facts(numbers(manifest)),
    free && h("a", { class: "btn", style: { textAlign: "center", textDecoration: "none", color: "inherit", lineHeight: "20px" }, href: href(`${shell.project.path}/programs/${kind}`), download: "", data: { key: `get-${kind}` } }, `Download ${title.toLowerCase()} (zip)`));
}

/** What of a manifest a person wants to know. */
function numbers(m) {
  const d = m.largest_difference ?? {};
  return [["Program", m.program ? h("span", { class: "num" }, m.program) : null], ["Files", whole(Object.keys(m.files ?? {}).length)], ["Poses", m.poses === undefined ? null : whole(m.poses)], ["Size", m.bytes === undefined ? null : bytes(m.bytes)],
    ["Written against planned", Number.isFinite(d.mm) ? `${fixed(d.mm, 4)} mm, ${fixed(d.deg, 4)}°` : null]];
}

export function footer(shell) {
  return h("a", { class: "btn primary", style: { textAlign: "center", textDecoration: "none", lineHeight: "26px" }, href: `#/p/${shell.project.id}/scan` }, "Continue: the scan");
}

export function drawer(shell) {
  const { plan } = shell.project.data;
  const free = KINDS.filter(([kind]) => plan?.programs?.[kind]?.available);
  return { stamp: `${plan?.number} ${plan?.stale}`, tabs: free.map(([kind, title]) => ({ key: kind, title: `KRL, ${title.toLowerCase()}`, draw: (body, alive) => krl(body, alive, `${shell.project.path}/programs/${kind}`) })) };
}
