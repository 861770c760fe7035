// The nine steps of the job: their state, and the one number that matters, from what the project holds.

import { deg, fixed, mm, pct, whole } from "./format.js";
import { toneOf } from "./status.js";

export const STEPS = [["part", "Part"], ["cell", "Cell"], ["surface", "Surface"], ["keypoints", "Key points"], ["paths", "Paths"], ["programs", "Programs"], ["scan", "Scan"], ["alignment", "Alignment"], ["report", "Report"]];
const TODO = { tone: "todo", word: "", fact: "" };
const done = (fact, word = "done") => ({ tone: "good", word, fact });

/** State of every step: {tone, word, fact}. */
export function journey(data) {
  const { part, setup, surface, keypoints, plan, scans, alignment, assessment, insight } = data;
  const errors = (list) => (list ?? []).filter((i) => i.severity === "error").length;
  const taught = setup && ["x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"].some((k) => setup.base[k] !== 0);
  const fresh = insight && insight.version === data.state?.versions?.keypoints ? insight : null;
  const bad = errors(fresh?.issues);
  const programs = plan?.programs ?? {};
  const free = Object.values(programs).filter((p) => p.available).length;
  const stale = (result, state) => (result.stale ? { ...state, tone: "warn", word: "out of date" } : state);
  const states = {
    part: part ? done(`${part.extents_mm.map((v) => fixed(v, v < 10 ? 1 : 0)).join(" × ")} mm`) : { ...TODO, word: "start here", fact: "Load the CAD of the part" },
    cell: !setup ? TODO : done(`${setup.robot}, ${setup.probe.elements === 1 ? "single crystal" : `${setup.probe.elements} elements`}`, taught ? "BASE taught" : "BASE untaught"),
    surface: !part ? TODO : done(plan && !plan.stale ? `${whole(plan.surface.area_mm2 / 100)} cm²` : surface?.seeds?.length ? "chosen" : "the largest face", surface?.seeds?.length ? "chosen" : "by default"),
    keypoints: keyPoints(keypoints, fresh, bad, part),
    paths: !plan ? TODO : stale(plan, { tone: errors(plan.issues) ? "bad" : "good", word: errors(plan.issues) ? `${errors(plan.issues)} to solve` : "planned", fact: `${whole(plan.inspection?.passes)} passes, ${pct(share(plan.inspection), 1)} swept` }),
    programs: !plan ? TODO : stale(plan, { tone: free === 2 ? "good" : "bad", word: free === 2 ? "proven" : "withheld", fact: `${free} of 2 programs ready` }),
    scan: !scans?.length ? TODO : done(`${scans.length} ${scans.length === 1 ? "scan" : "scans"}`, scans.at(-1).origin === "simulated" ? "rehearsed" : "uploaded"),
    alignment: !alignment ? TODO : stale(alignment, { tone: alignment.accepted ? "good" : toneOf(alignment.verdict), word: alignment.accepted ? "accepted" : alignment.verdict, fact: moved(alignment.correction) }),
    report: report(alignment, assessment),
  };
  const told = Object.fromEntries((data.state?.steps ?? []).map((s) => [s.name, s]));
  return STEPS.map(([id, name]) => {
    const state = { ...states[id] };
    if (told[id]?.state === "running") Object.assign(state, { tone: "busy", word: "working" });
    else if (told[id]?.job?.state === "failed") Object.assign(state, { tone: "bad", word: "failed" });
    // What is not done yet says what to do.
    if (!state.fact && state.tone === "todo" && told[id]?.state !== "empty") state.fact = told[id]?.next ?? "";
    return { id, name, ...state };
  });
}

/** Share of the inspection surface that a planned path covers, whatever the plan calls it. */
export const share = (path) => path?.coverage?.share ?? path?.coverage?.swept_share ?? null;

/** Length and turn of a correction in words. */
export function moved(c) {
  if (!c) return "";
  return `${mm(Math.hypot(c.x_mm, c.y_mm, c.z_mm))} mm, ${deg(Math.max(...["a_deg", "b_deg", "c_deg"].map((k) => Math.abs(c[k]))))}°`;
}

function keyPoints(keypoints, insight, bad, part) {
  if (!part) return TODO;
  const n = keypoints?.length ?? 0;
  if (!n) return { tone: "todo", word: "", fact: "none: EchoBase will choose" };
  const coverage = insight?.coverage ?? null;
  if (coverage === null && !bad) return { tone: "busy", word: "computing", fact: `${n}, coverage is being computed` };
  const fact = `${n}, ${coverage === null ? "coverage unknown" : `${pct(coverage)} covered`}`;
  return bad ? { tone: "bad", word: `${bad} unusable`, fact } : done(fact, "picked");
}

function report(alignment, assessment) {
  if (!alignment) return TODO;
  if (assessment) return { tone: assessment.stale ? "warn" : "good", word: "assessed", fact: `${pct(assessment.after?.within_2db)} within 2 dB` };
  if (alignment.program?.available) return done("corrected program ready", "released");
  return { tone: alignment.stale ? "warn" : "todo", word: alignment.stale ? "out of date" : alignment.verdict === "partial" ? "to accept" : "withheld", fact: "" };
}

/** A signed value for a table. */
export const signed = (v, decimals) => (Number.isFinite(v) && v > 0 ? `+${fixed(v, decimals)}` : fixed(v, decimals));
