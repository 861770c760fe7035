// Modal questions. Each returns a promise: the answer, or null if the person backed out.

import { button, h } from "./dom.js";
import { AXES, isAngle } from "./format.js";

/** Ask with a form; `fields(form)` are nodes, `read(form)` the answer. */
function ask(title, text, fields, yes, read) {
  return new Promise((resolve) => {
    let answer = null;
    const form = h("form", { method: "dialog", onsubmit: (e) => { e.preventDefault(); answer = read(form); node.close(); } },
      h("h2", {}, title), text && h("p", { class: "soft" }, text), fields,
      h("div", { class: "ends" }, button("Cancel", () => node.close()), h("button", { type: "submit", class: "btn primary" }, yes)));
    const node = h("dialog", { onclose: () => { node.remove(); resolve(answer); } }, form);
    document.body.append(node);
    node.showModal();
    form.querySelector("input, textarea, select")?.focus();
  });
}

const labelled = (text, input) => h("label", { class: "stack" }, h("span", { class: "soft small" }, text), input);

/** Ask for a short text. */
export const askText = (title, label, value, yes = "OK") =>
  ask(title, "", labelled(label, h("input", { type: "text", name: "text", value, required: true, maxlength: 200 })), yes, (f) => f.elements.text.value.trim());

/** Ask before something that cannot be undone. */
export const confirm = (title, text, yes) => ask(title, text, [], yes, () => true);

/** Ask who accepts a result that is not a plain pass, and why. */
export function askAcceptance(reasons) {
  return ask("Accept a partial result", "The corrected program is released under your name. What is not a pass stays written in the report and in the program's header.",
    [reasons, labelled("Your name", h("input", { type: "text", name: "who", required: true, maxlength: 80, autocomplete: "name", value: remembered() })),
      labelled("Reason", h("textarea", { name: "reason", required: true, rows: 3, maxlength: 1000 }))],
    "Accept", (f) => { remember(f.elements.who.value); return { name: f.elements.who.value.trim(), reason: f.elements.reason.value.trim() }; });
}

/** Ask for the hidden truth of a rehearsal. `draw()` makes one; `own` is the sample's, `last` where the part was hidden before. */
export function askRehearsal(path, draw, { own = null, last = null, springBack = 0 } = {}) {
  const inputs = {};
  const six = h("div", { class: "six" }, AXES.map((axis) => {
    inputs[axis] = h("input", { type: "number", name: axis, step: "any", value: "0", required: true });
    return h("label", {}, `${axis.toUpperCase()} (${isAngle(axis) ? "deg" : "mm"})`, inputs[axis]);
  }));
  const shuffle = (offset = draw()) => { for (const axis of AXES) inputs[axis].value = String(offset[axis]); };
  shuffle(last ?? own ?? draw());
  const hide = h("input", { type: "checkbox", name: "hide", onchange: () => six.classList.toggle("hidden", hide.checked) });
  const number = (name, text, value, props) => labelled(text, h("input", { type: "number", name, value, step: "any", ...props }));
  return ask("Rehearse with the simulated scanner", `The ${path} program runs on a simulated robot. The part stands away from where the program believes it is; the alignment has to find out by how much.`,
    [six, h("div", { class: "row" }, last && button("As scanned", () => shuffle(last), { title: "Where the part stood in the last alignment scan" }), own && button("The sample's", () => shuffle(own), { title: "The offset that belongs to this sample" }), button("Random", () => shuffle(), { title: "Drawn from the fixture's tolerance in the cell" }), h("label", { class: "row tight" }, hide, "Do not show me")),
      h("div", { class: "six" }, number("spring", "Spring back (mm)", String(springBack), { min: -100, max: 100 }), number("outliers", "Outliers (%)", "0", { min: 0, max: 90 }), number("dropouts", "Dropouts (%)", "0", { min: 0, max: 90 }))],
    "Run", (f) => ({
      path,
      offset: Object.fromEntries(AXES.map((a) => [`${a}_${isAngle(a) ? "deg" : "mm"}`, Number(inputs[a].value)])),
      spring_back_mm: Number(f.elements.spring.value),
      outliers: Number(f.elements.outliers.value) / 100,
      dropouts: Number(f.elements.dropouts.value) / 100,
      seed: crypto.getRandomValues(new Uint32Array(1))[0] % 2147483647,
    }));
}

/** The name a person gave last, kept in this browser. */
export const remembered = () => { try { return localStorage.getItem("echobase-name") ?? ""; } catch { return ""; } };
const remember = (name) => { try { localStorage.setItem("echobase-name", name); } catch { /* private window */ } };
