// Verdicts and issues: a colour never stands alone, there is always a word and a sign.

import { h } from "./dom.js";

const SIGNS = { good: "✓", warn: "!", bad: "✕", none: "–", busy: "…", todo: "○" };
const SEVERITY = { error: "✕", warning: "!", info: "i" };

/** The sign of a tone. */
export const sign = (tone) => SIGNS[tone] ?? SIGNS.none;

/** A verdict box: tone, word, explanation. */
export function verdict(tone, word, text = "") {
  return h("div", { class: `verdict ${tone}`, role: "status" }, h("span", { class: "sign", "aria-hidden": "true" }, sign(tone)), h("div", {}, h("b", {}, word), text && h("p", { class: "small" }, text)));
}

/** A small word in its tone. */
export const tag = (tone, word) => h("span", { class: `tag ${tone}` }, `${sign(tone)} ${word}`);

/** A list of issues with their remedies; errors first, at most `limit` shown, the rest counted. */
export function issueList(issues, limit = 12) {
  if (!issues?.length) return null;
  const rank = { error: 0, warning: 1, info: 2 };
  const sorted = [...issues].sort((a, b) => (rank[a.severity] ?? 3) - (rank[b.severity] ?? 3));
  const rows = sorted.slice(0, limit).map((issue) =>
    h("li", { class: `issue ${issue.severity}` },
      h("span", { class: "sign", title: issue.severity }, SEVERITY[issue.severity] ?? "i"),
      h("span", {}, sentence(issue.message)),
      issue.remedy && h("span", { class: "remedy small" }, issue.remedy),
      issue.where && h("span", { class: "where" }, issue.where)));
  const rest = sorted.length - rows.length;
  return h("section", {}, h("h3", {}, count(sorted)), h("ul", { class: "issues" }, rows), rest > 0 && h("p", { class: "faint small" }, `and ${rest} more`));
}

function sentence(text) {
  const t = String(text ?? "");
  return t.charAt(0).toUpperCase() + t.slice(1);
}

function count(issues) {
  const of = (s) => issues.filter((i) => i.severity === s).length;
  const words = [["error", "errors"], ["warning", "warnings"], ["info", "notes"]].map(([s, plural]) => {
    const n = of(s);
    return n ? `${n} ${n === 1 ? plural.slice(0, -1) : plural}` : null;
  });
  return words.filter(Boolean).join(", ");
}

/** The tone of a verdict of a result. */
export const toneOf = (word) => ({ pass: "good", partial: "warn", fail: "bad", measured: "good", weak: "warn", held: "none", matched: "good", rejected: "bad", unmatched: "bad" })[word] ?? "none";

/** What runs now, in place of a verdict: the line the job says, and how far it is. */
export function working(shell, word, ...kinds) {
  const job = [...shell.project.data.jobs.values()].find((j) => kinds.includes(j.kind) && ["queued", "running"].includes(j.state));
  return h("div", { class: "verdict busy", role: "status" }, h("span", { class: "sign", "aria-hidden": "true" }, sign("busy")), h("div", {}, h("b", {}, word), h("p", { class: "small" }, job?.text ? sentence(job.text) : "Waiting for its turn"), h("progress", { value: job?.fraction ?? 0, max: 1, "aria-label": word })));
}
