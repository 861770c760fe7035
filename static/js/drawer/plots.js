// Plotly from the server's own copy, loaded when the first chart is looked at.

import { fill, h } from "../dom.js";
import { fixed, whole } from "../format.js";

let loading = null;
function plotly() {
  loading ??= new Promise((resolve, reject) => {
    const script = h("script", { src: "vendor/plotly.min.js" });
    script.onload = () => resolve(window.Plotly);
    script.onerror = () => { loading = null; reject(new Error("The charts could not be loaded.")); };
    document.head.append(script);
  });
  return loading;
}

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const axis = (title, more = {}) => ({ title: { text: title, font: { size: 11 } }, zeroline: false, gridcolor: "#e7eaed", linecolor: "#c3c9ce", tickfont: { size: 11 }, ...more });
const layout = (title, x, y, more = {}) => ({
  title: { text: title, font: { size: 12 }, x: 0.02, xanchor: "left", y: 0.99, yanchor: "top", pad: { t: 14 } }, margin: { l: 48, r: 14, t: 30, b: 38 }, showlegend: false,
  font: { family: css("--font"), color: css("--ink-2"), size: 11 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", xaxis: x, yaxis: y, bargap: 0.04, ...more,
});
const config = { displaylogo: false, displayModeBar: false, responsive: true };

/** Draw charts side by side: [{traces, layout}]. */
async function draw(body, alive, charts) {
  const Plotly = await plotly();
  if (!alive()) return;
  const boxes = charts.map(() => h("div", { class: "chart" }));
  fill(body, h("div", { class: "charts" }, boxes));
  for (const [i, chart] of charts.entries()) await Plotly.newPlot(boxes[i], chart.traces, chart.layout, config);
}

const TITLES = { before: "before", after: "after", scan: "scan" };

// The first word of a title is the quantity: what stands along the axis, with its unit.
const quantity = (chart) => `${chart.title.split(" ")[0]}, ${chart.unit}`;

/** Histograms of one chart of the server, one box per series. */
export function histograms(body, alive, ...charts) {
  return draw(body, alive, charts.flatMap((chart) => Object.entries(chart.series).map(([name, s]) => {
    const middle = s.edges.slice(1).map((e, i) => (e + s.edges[i]) / 2);
    const numbers = s.n ? `mean ${fixed(s.mean, 3)}, std ${fixed(s.std, 3)}, range ${fixed(s.range, 2)} ${chart.unit}` : "no readings";
    const shapes = chart.tolerance ? [-1, 1].map((k) => ({ type: "line", x0: k * chart.tolerance, x1: k * chart.tolerance, y0: 0, y1: 1, yref: "paper", line: { color: css("--ink-3"), width: 1, dash: "dot" } })) : [];
    return {
      traces: [{ type: "bar", x: middle, y: s.counts, marker: { color: name === "before" ? "#9aa5af" : css("--accent") }, hovertemplate: `%{x:.3f} ${chart.unit}: %{y}<extra></extra>` }],
      layout: layout(`${chart.title}, ${TITLES[name] ?? name}<br><span style="font-size:11px">${numbers}</span>`, axis(quantity(chart)), axis(`${whole(s.n)} readings`), { shapes, margin: { l: 48, r: 14, t: 48, b: 38 } }),
    };
  })));
}

/** Histograms with all series of a chart in one box, on one scale. */
export function overlaid(body, alive, ...charts) {
  return draw(body, alive, charts.map((chart) => {
    const series = Object.entries(chart.series);
    const traces = series.map(([name, s]) => ({ type: "bar", name: TITLES[name] ?? name, x: s.edges.slice(1).map((e, i) => (e + s.edges[i]) / 2), y: s.counts, opacity: 0.75, marker: { color: name === "before" ? "#9aa5af" : css("--accent") }, hovertemplate: `${TITLES[name] ?? name}, %{x:.3f} ${chart.unit}: %{y}<extra></extra>` }));
    const numbers = series.map(([name, s]) => `${TITLES[name] ?? name}: mean ${fixed(s.mean, 3)}, std ${fixed(s.std, 3)}`).join("; ");
    const shapes = chart.tolerance ? [-1, 1].map((k) => ({ type: "line", x0: k * chart.tolerance, x1: k * chart.tolerance, y0: 0, y1: 1, yref: "paper", line: { color: css("--ink-3"), width: 1, dash: "dot" } })) : [];
    return { traces, layout: layout(`${chart.title}<br><span style="font-size:11px">${numbers}</span>`, axis(quantity(chart)), axis("readings"), { shapes, barmode: "overlay", showlegend: true, legend: { x: 1, xanchor: "right", y: 1 }, margin: { l: 48, r: 14, t: 48, b: 38 } }) };
  }));
}

/** Maps of laws by poses. */
export function maps(body, alive, charts) {
  return draw(body, alive, charts.map((c) => ({
    traces: [{ type: "heatmap", z: c.z, x0: 1, dx: c.poses / (c.z[0]?.length || 1), y0: 1, dy: c.laws / (c.z.length || 1), colorscale: "Cividis", colorbar: { title: { text: c.unit, font: { size: 11 } }, thickness: 10, outlinewidth: 0 }, hovertemplate: `pose %{x:.0f}, law %{y:.0f}: %{z:.3f} ${c.unit}<extra></extra>` }],
    layout: layout(c.title, axis("pose"), axis("law")),
  })));
}

/** Maps over the part of one quantity, on one scale, in the colours of the 3D view. */
export function surfaceMaps(body, alive, charts, unit) {
  const scale = charts.colours.map((c, i) => [i / (charts.colours.length - 1), c]);
  const list = charts.maps.filter((m) => m.unit === unit);
  return draw(body, alive, list.map((m) => ({
    traces: [{ type: "heatmap", z: m.z, x0: m.x0, dx: m.cell_mm, y0: m.y0, dy: m.cell_mm, zmin: -m.limit, zmax: m.limit, colorscale: scale, colorbar: { title: { text: m.unit, font: { size: 11 } }, thickness: 10, outlinewidth: 0 }, hovertemplate: `%{x:.1f}, %{y:.1f} mm: %{z:.3f} ${m.unit}<extra></extra>` }],
    layout: layout(`${m.title}, ${TITLES[m.series] ?? m.series}`, axis(m.x_title), axis(m.y_title, { scaleanchor: "x" })),
  })));
}

/** The front wall of one law along the scan. */
export function profile(body, alive, c) {
  return draw(body, alive, [{
    traces: [{ type: "scatter", mode: "markers", x: c.pose, y: c.distance, marker: { size: 3, color: css("--accent") }, hovertemplate: "pose %{x}: %{y:.3f} mm<extra></extra>" }],
    layout: layout(c.title, axis("pose"), axis("distance, mm", { autorange: "reversed" }), { shapes: [{ type: "line", x0: 0, x1: 1, xref: "paper", y0: c.standoff, y1: c.standoff, line: { color: css("--ink-3"), width: 1, dash: "dot" } }] }),
  }]);
}
