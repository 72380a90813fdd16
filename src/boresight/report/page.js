"use strict";
(() => {
const D = JSON.parse(document.getElementById("data").textContent);
const $ = id => document.getElementById(id);
const T = 100, L = 10; // times in 10 ms, places in 0.1 m
const SENSOR = ["#c4452f", "#2a7f9e", "#7a5195", "#3d8b37", "#b8860b", "#5c6b7a", "#a0527a", "#00796b"];
const FATE = {updated: "#2f7d4f", initiated: "#7fb77e", unassociated: "#c9ced4", gated: "#e0a458", screened: "#c4452f",
  late: "#7a5195", duplicate: "#8a6d5a", out_of_coverage: "#9db4c0", no_detection: "#e6eaee", not_selected: "#f0f2f4"};
const STATUS = {tentative: "#b9c4ce", confirmed: "#2a7f9e", coasting: "#e0a458"};
const trackColour = id => `hsl(${(id * 137.508) % 360} 68% 40%)`;
const sensorColour = i => SENSOR[i % SENSOR.length];
const sensors = D.sensors || [], truth = D.truth || [], platforms = D.platforms || [], ignored = D.ignore || [];
const span = D.duration_s || 1;

// ---------- small helpers
function sig(v, n = 4) {
  if (v === null || v === undefined) return "–";
  if (typeof v === "boolean") return v ? "yes" : "no";
  if (typeof v !== "number") return Array.isArray(v) ? v.map(w => sig(w, n)).join(", ") : String(v);
  if (Number.isInteger(v)) return String(v);
  const a = Math.abs(v);
  return a >= 1e15 || a < 1e-3 ? String(+v.toPrecision(3)) : String(+v.toPrecision(a >= 10 ** n ? Math.ceil(Math.log10(a)) : n));
}
function make(tag, attributes = {}, ...inner) {
  const e = document.createElement(tag);
  for (const [k, v] of Object.entries(attributes)) k === "class" ? e.className = v : e.setAttribute(k, v);
  e.append(...inner);
  return e;
}
function svg(tag, attributes = {}, text) {
  const e = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [k, v] of Object.entries(attributes)) e.setAttribute(k, v);
  if (text !== undefined) e.textContent = text;
  return e;
}
function steps(lo, hi, n) { // round values between lo and hi
  const raw = (hi - lo) / Math.max(n, 1), p = 10 ** Math.floor(Math.log10(raw || 1)), f = raw / p;
  const step = p * (f > 5 ? 10 : f > 2 ? 5 : f > 1 ? 2 : 1), out = [];
  for (let v = Math.ceil(lo / step - 1e-9) * step; v <= hi + 1e-9 * step; v += step) out.push(+v.toPrecision(12));
  return out;
}
function table(columns, rows) { // columns: [key, heading, word?]
  const t = make("table"), head = make("tr");
  for (const [, h, word] of columns) head.append(make("th", word ? {class: "word"} : {}, h));
  t.append(make("thead", {}, head));
  const body = make("tbody");
  for (const r of rows) body.append(make("tr", {}, ...columns.map(([k, , word]) => make("td", word ? {class: "word"} : {}, sig(r[k])))));
  t.append(body);
  return make("div", {class: "scroll"}, t);
}
function hide(id) { $(id).style.display = "none"; }
const redraws = [];
function drawn(f) { redraws.push(f); f(); }
let resizing;
let lastWidth = innerWidth;
addEventListener("resize", () => {
  if (innerWidth === lastWidth) return;
  lastWidth = innerWidth;
  clearTimeout(resizing);
  resizing = setTimeout(() => redraws.forEach(f => f()), 120);
});

// ---------- line charts
function chart(where, o) {
  const box = make("div", {class: "chart"});
  if (o.title) where.append(make("h3", {}, o.title));
  where.append(box);
  drawn(() => {
    const W = Math.max(box.clientWidth, 260), H = o.height || 190, m = {l: 46, r: 10, t: 8, b: 32};
    const flat = k => [...(o.series || []).flatMap(s => s[k]), ...(k === "y" ? (o.bands || []).flatMap(b => [...b.lo, ...b.hi]) : [])].filter(v => v !== null && isFinite(v));
    const range = (k, given) => {
      const v = flat(k); let lo = Infinity, hi = -Infinity;
      for (const w of v) { if (w < lo) lo = w; if (w > hi) hi = w; }
      if (!isFinite(lo)) { lo = 0; hi = 1; }
      if (given) { lo = given[0] ?? lo; hi = given[1] ?? hi; }
      if (hi - lo < 1e-9) { lo -= 0.5; hi += 0.5; }
      return [lo, hi];
    };
    const [x0, x1] = range("x", o.x);
    let [y0, y1] = range("y", o.y);
    if (!o.y || o.y[1] == null) y1 += 0.06 * (y1 - y0);
    if (!o.y || o.y[0] == null) y0 -= 0.06 * (y1 - y0);
    const X = v => m.l + (v - x0) / (x1 - x0) * (W - m.l - m.r), Y = v => H - m.b - (v - y0) / (y1 - y0) * (H - m.t - m.b);
    const s = svg("svg", {viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": o.title || o.yl || "chart"});
    const clip = "c" + Math.random().toString(36).slice(2);
    const cp = svg("clipPath", {id: clip});
    cp.append(svg("rect", {x: m.l, y: m.t, width: W - m.l - m.r, height: H - m.t - m.b}));
    s.append(cp);
    for (const v of steps(y0, y1, H / 36)) {
      s.append(svg("line", {x1: m.l, x2: W - m.r, y1: Y(v), y2: Y(v), stroke: "#e6ebf0"}));
      s.append(svg("text", {x: m.l - 6, y: Y(v) + 4, "text-anchor": "end"}, sig(v)));
    }
    for (const v of steps(x0, x1, W / 90)) {
      s.append(svg("line", {x1: X(v), x2: X(v), y1: m.t, y2: H - m.b, stroke: "#f0f3f6"}));
      s.append(svg("text", {x: X(v), y: H - m.b + 14, "text-anchor": "middle"}, sig(v)));
    }
    s.append(svg("text", {x: W - m.r, y: H - 3, "text-anchor": "end"}, o.xl || "time, s"));
    if (o.yl) s.append(svg("text", {x: m.l + 4, y: m.t + 10}, o.yl));
    const g = svg("g", {"clip-path": `url(#${clip})`});
    for (const b of o.bands || []) {
      for (const [i, j] of pieces(b.x, o.gap)) {
        let d = "";
        for (let k = i; k < j; k++) d += (k > i ? "L" : "M") + X(b.x[k]).toFixed(1) + " " + Y(b.hi[k]).toFixed(1);
        for (let k = j - 1; k >= i; k--) d += "L" + X(b.x[k]).toFixed(1) + " " + Y(b.lo[k]).toFixed(1);
        g.append(svg("path", {d: d + "Z", fill: b.colour, opacity: b.opacity || 0.18}));
      }
    }
    for (const v of o.lines || []) g.append(svg("line", {x1: m.l, x2: W - m.r, y1: Y(v), y2: Y(v), stroke: "#5b6875", "stroke-dasharray": "4 3"}));
    for (const q of o.series || []) {
      let d = "";
      for (const [i, j] of pieces(q.x, o.gap)) for (let k = i; k < j; k++) if (q.y[k] !== null)
        d += (k > i && q.y[k - 1] !== null ? "L" : "M") + X(q.x[k]).toFixed(1) + " " + Y(q.y[k]).toFixed(1) + (j - i === 1 ? "h.1" : "");
      g.append(svg("path", {d, fill: "none", stroke: q.colour, "stroke-width": q.width || 1.4, "stroke-linecap": "round", "stroke-dasharray": q.dash || "none", opacity: q.opacity || 1}));
    }
    s.append(g);
    box.replaceChildren(s);
    const tip = make("div", {class: "tip"});
    box.append(tip);
    s.addEventListener("pointermove", e => {
      const r = s.getBoundingClientRect(), x = x0 + ((e.clientX - r.left) * W / r.width - m.l) / (W - m.l - m.r) * (x1 - x0), words = [];
      for (const q of (o.series || []).filter(q => q.label).slice(0, 6)) {
        let best = -1, far = (x1 - x0) * 0.03;
        for (let k = 0; k < q.x.length; k++) { const dx = Math.abs(q.x[k] - x); if (dx < far) { far = dx; best = k; } }
        if (best >= 0) words.push(`${q.label} ${sig(q.y[best], 3)}`);
      }
      tip.style.display = words.length ? "block" : "none";
      tip.textContent = `${sig(x, 4)}\n` + words.join("\n");
      tip.style.left = Math.min(e.clientX - r.left + 12, r.width - 120) + "px"; tip.style.top = "10px";
    });
    s.addEventListener("pointerleave", () => tip.style.display = "none");
  });
}
function pieces(x, gap) { // runs without a step longer than gap
  const out = []; let i = 0;
  for (let k = 1; k <= x.length; k++) if (k === x.length || (gap && x[k] - x[k - 1] > gap)) { out.push([i, k]); i = k; }
  return x.length ? out : [];
}
const key = items => make("div", {class: "key"}, ...items.map(([c, w, bar]) => make("span", {}, make("i", {class: "swatch" + (bar ? " bar" : ""), style: `background:${c}`}), " " + w)));

// ---------- head
$("name").textContent = D.name;
$("version").textContent = D.version;
$("about").textContent = `${D.dimensions}-D, ${sig(span, 4)} s` + (sensors.length ? `, sensors ${sensors.map(s => s.id).join(", ")}` : "") + `, times from ${D.start_s.toFixed(3)} s`;
const scores = D.scores || [], own = scores.find(r => r.item === "tracks"), none = scores.find(r => r.item === "empty tracker");
const counts = D.summary.counts || {};
const tiles = [[String(D.tracks.length), "tracks"], [String(counts.reports ?? D.outcome.reduce((a, r) => a + r.rows, 0)), "reports"]];
if (own) tiles.push([sig(own.gospa_rms_m, 3) + " m", `GOSPA RMS, cut off at ${sig(own.cut_off_m, 3)} m (empty tracker ${sig(none.gospa_rms_m, 3)})`],
  [own.tracked_fraction === null ? "–" : sig(100 * own.tracked_fraction, 3) + " %", "of the time tracked"], [sig(own.position_rmse_m, 3) + (own.position_rmse_m === null ? "" : " m"), "position RMSE"],
  [sig(own.false_track_s, 3) + " s", "of false tracks"], [sig(own.nees_mean, 3), `NEES (${D.dimensions} is right)`]);
for (const [v, w] of tiles) $("tiles").append(make("div", {class: "tile"}, make("b", {}, v), make("span", {}, w)));

// ---------- bound
if (D.summary.bound && D.summary.bound.length) {
  const rows = D.summary.bound, x = rows.map(r => r.time_s), kinds = [["radar", "radar alone", "#c4452f"], ["ir", "infrared alone", "#7a5195"], ["both", "both", "#0b6aa2"]];
  chart($("bound"), {series: kinds.flatMap(([k, w, colour]) => [{x, y: rows.map(r => r[k + "_rmse_m"]), colour, width: 2.4, label: w + ", m"}, {x, y: rows.map(r => r[k + "_bound_m"]), colour, dash: "2 4", width: 2.4, label: w + " bound, m"}]), x: [x[0], x[x.length - 1]], y: [0, null], yl: "position error, m", height: 260});
  $("bound").append(key(kinds.map(([, w, c]) => [c, w, true])));
} else hide("bound-section");

// ---------- plan view
const canvas = $("plan"), ctx = canvas.getContext("2d"), tip = $("tip");
const show = {tracks: true, truth: true, platforms: true, ignored: true};
sensors.forEach(s => show["s:" + s.id] = true);
let view = null, now = null, W = 0, H = 0;
function toggle(name, label, colour, bar) {
  const input = make("input", {type: "checkbox"});
  input.checked = true;
  input.addEventListener("change", () => { show[name] = input.checked; plan(); });
  $("toggles").append(make("label", {}, input, make("i", {class: "swatch" + (bar ? " bar" : ""), style: `background:${colour}`}), label));
}
toggle("tracks", "tracks (a colour each)", "linear-gradient(90deg,#1f77b4,#2ca02c,#d62728)", true);
if (truth.length) toggle("truth", "truth", "#111", true);
if (platforms.length) toggle("platforms", "platforms", "#8a94a0", true);
if (ignored.length) toggle("ignored", "real, but without truth: not scored", "#f0d9a8", true);
sensors.forEach((s, i) => toggle("s:" + s.id, s.id + (s.rays.t.length ? " (bearings: use the time slider)" : ""), sensorColour(i)));

function fit() {
  const xs = [], ys = [];
  for (const p of [...D.tracks, ...truth, ...platforms]) { xs.push(...sample(p.x)); ys.push(...sample(p.y)); }
  if (xs.length < 4 || !D.tracks.length && !truth.length) for (const s of sensors) { xs.push(...sample(s.points.x, 400)); ys.push(...sample(s.points.y, 400)); }
  let [a, b] = ends(xs), [c, d] = ends(ys);
  const pad = 0.08 * Math.max(b - a, d - c, 200);
  a -= pad; b += pad; c -= pad; d += pad;
  view = {x: (a + b) / 2, y: (c + d) / 2, s: Math.min(W / (b - a), H / (d - c))};
}
const sample = (v, n = 60) => { const k = Math.max(1, Math.floor(v.length / n)); return v.filter((w, i) => (i % k === 0 || i === v.length - 1) && w !== null); };
const ends = v => v.length ? v.reduce(([a, b], w) => [Math.min(a, w), Math.max(b, w)], [Infinity, -Infinity]) : [-1000, 1000];
const px = x => W / 2 + (x - view.x) * view.s, py = y => H / 2 - (y - view.y) * view.s;
function until(t, at) { let a = 0, b = t.length; while (a < b) { const m = (a + b) >> 1; t[m] <= at ? a = m + 1 : b = m; } return a; }

function line(p, from, to, gap) {
  ctx.beginPath();
  for (let k = from; k < to; k++) {
    const X = px(p.x[k]), Y = py(p.y[k]);
    k > from && p.t[k] - p.t[k - 1] <= gap ? ctx.lineTo(X, Y) : ctx.moveTo(X, Y);
  }
  ctx.stroke();
}
function plan() {
  const ratio = Math.min(devicePixelRatio || 1, 2);
  W = canvas.parentElement.clientWidth; H = Math.round(Math.min(Math.max(W * 0.62, 300), 660));
  if (canvas.width !== Math.round(W * ratio) || canvas.height !== Math.round(H * ratio)) {
    canvas.width = Math.round(W * ratio); canvas.height = Math.round(H * ratio); canvas.style.height = H + "px"; fit();
  }
  if (!view) fit();
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.fillStyle = "#fbfcfd"; ctx.fillRect(0, 0, W, H);
  grid();
  const at = now === null ? Infinity : now * T, trail = now === null ? Infinity : Math.max(20, span / 8) * T;
  if (show.ignored) for (const p of ignored) {
    ctx.strokeStyle = "#f0d9a8"; ctx.lineWidth = 9; ctx.lineCap = "round"; ctx.globalAlpha = 0.7; line(p, 0, p.t.length, Infinity); ctx.globalAlpha = 1;
  }
  sensors.forEach((s, i) => { if (show["s:" + s.id]) detections(s, sensorColour(i), at); });
  ctx.lineCap = "butt";
  if (show.platforms) for (const p of platforms) {
    ctx.strokeStyle = "#8a94a0"; ctx.lineWidth = 2; line(p, 0, p.t.length, Infinity);
    const k = Math.max(0, Math.min(until(p.t, at), p.t.length) - 1); mark(px(p.x[k]), py(p.y[k]), "#5b6875", 4); label(p.id, p.x[k], p.y[k], "#5b6875");
  }
  if (show.truth) for (const p of truth) {
    const to = until(p.t, at), from = now === null ? 0 : until(p.t, at - trail);
    ctx.setLineDash([5, 4]); ctx.strokeStyle = "#111"; ctx.lineWidth = 1.5; line(p, from, to, Infinity); ctx.setLineDash([]);
    if (to > from && (now === null || at <= p.t[p.t.length - 1] + T)) { if (truth.length <= 100) mark(px(p.x[to - 1]), py(p.y[to - 1]), "#111", 2.5); if (truth.length <= 12) label(p.id, p.x[to - 1], p.y[to - 1], "#111", -8); }
  }
  if (show.tracks) for (const p of D.tracks) {
    const to = until(p.t, at), from = now === null ? 0 : until(p.t, at - trail);
    if (to <= from || now !== null && at - p.t[to - 1] > 2 * T && p.t[p.t.length - 1] < at) continue;
    ctx.strokeStyle = trackColour(p.id); ctx.lineWidth = D.tracks.length > 300 ? 1 : 2; line(p, from, to, gapOf(p));
    if (now !== null) mark(px(p.x[to - 1]), py(p.y[to - 1]), trackColour(p.id), 3.5);
    if (D.tracks.length <= 40 || now !== null && D.tracks.length <= 200) label(p.id, p.x[to - 1], p.y[to - 1], trackColour(p.id));
  }
}
function gapOf(p) { return p.gap ??= Math.max(3 * T, 4 * (p.t[p.t.length - 1] - p.t[0]) / Math.max(p.t.length - 1, 1)); }
function mark(X, Y, colour, r) { ctx.fillStyle = colour; ctx.beginPath(); ctx.arc(X, Y, r, 0, 7); ctx.fill(); }
function label(text, x, y, colour, dx = 6) {
  ctx.font = "600 12px system-ui,sans-serif"; ctx.textAlign = dx < 0 ? "right" : "left"; ctx.lineWidth = 3; ctx.strokeStyle = "#fbfcfdcc";
  ctx.strokeText(text, px(x) + dx, py(y) - 5); ctx.fillStyle = colour; ctx.fillText(text, px(x) + dx, py(y) - 5);
}
function detections(s, colour, at) {
  const p = s.points, recent = 3 * T;
  ctx.fillStyle = colour;
  const n = p.t.length;
  for (let k = 0; k < n; k++) {
    if (now !== null && (p.t[k] > at || p.t[k] < at - recent)) continue;
    ctx.globalAlpha = now !== null ? (p.u[k] ? 0.95 : 0.5) : n > 8000 ? (p.u[k] ? 0.35 : 0.12) : p.u[k] ? 0.55 : 0.22;
    const r = now !== null ? 2.6 : n > 8000 ? 1 : 1.6;
    ctx.fillRect(px(p.x[k]) - r, py(p.y[k]) - r, 2 * r, 2 * r);
  }
  if (now !== null) {
    const q = s.rays, far = 2 * (W + H) / view.s;
    ctx.strokeStyle = colour; ctx.lineWidth = 1;
    for (let k = 0; k < q.t.length; k++) {
      if (q.t[k] > at || q.t[k] < at - 0.6 * T) continue;
      const a = q.a[k] * Math.PI / 1800;
      ctx.globalAlpha = q.u[k] ? 0.6 : 0.15;
      ctx.beginPath(); ctx.moveTo(px(q.x[k]), py(q.y[k])); ctx.lineTo(px(q.x[k] + far * Math.sin(a)), py(q.y[k] + far * Math.cos(a))); ctx.stroke();
    }
  }
  ctx.globalAlpha = 1;
}
function grid() {
  ctx.font = "11px system-ui,sans-serif"; ctx.lineWidth = 1; ctx.strokeStyle = "#e6ebf0"; ctx.fillStyle = "#7b8794";
  const w = W / view.s / L, h = H / view.s / L, km = Math.max(w, h) > 8000, unit = km ? 1000 : 1;
  const x0 = view.x / L - w / 2, y0 = view.y / L - h / 2;
  for (const v of steps(x0, x0 + w, W / 75)) { const X = px(v * L); ctx.beginPath(); ctx.moveTo(X, 0); ctx.lineTo(X, H); ctx.stroke(); if (X > 60 && X < W - 20) { ctx.textAlign = "center"; ctx.fillText(sig(v / unit), X, H - 5); } }
  for (const v of steps(y0, y0 + h, H / 65)) { const Y = py(v * L); ctx.beginPath(); ctx.moveTo(0, Y); ctx.lineTo(W, Y); ctx.stroke(); if (Y > 24 && Y < H - 24) { ctx.textAlign = "left"; ctx.fillText(sig(v / unit), 4, Y - 3); } }
  ctx.textAlign = "left"; ctx.fillText(`north, ${km ? "km" : "m"} ↑   east, ${km ? "km" : "m"} →`, 4, 13);
}
function setTime(v) {
  now = v; $("slider").value = v === null ? 1000 : Math.round(1000 * v / span);
  $("when").textContent = v === null ? "all" : v.toFixed(1) + " s"; plan();
}
$("slider").addEventListener("input", e => setTime(e.target.value / 1000 * span));
$("all").addEventListener("click", () => { playing = false; $("go").textContent = "play"; setTime(null); });
$("home").addEventListener("click", () => { fit(); plan(); });
let playing = false;
$("go").addEventListener("click", () => {
  playing = !playing; $("go").textContent = playing ? "pause" : "play";
  if (!playing) return;
  if (now === null || now >= span) now = 0;
  let before = performance.now();
  const frame = t => {
    if (!playing) return;
    setTime(Math.min(span, now + (t - before) / 1000 * span / 20)); before = t;
    if (now >= span) { playing = false; $("go").textContent = "play"; } else requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
});
let drag = null;
canvas.addEventListener("pointerdown", e => { if (e.pointerType === "mouse") { drag = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); } });
canvas.addEventListener("pointerup", () => drag = null);
canvas.addEventListener("dblclick", e => { zoom(e, e.shiftKey ? 0.5 : 2); });
canvas.addEventListener("wheel", e => { if (e.ctrlKey || document.activeElement === canvas) { e.preventDefault(); zoom(e, Math.exp(-e.deltaY / 400)); } }, {passive: false});
function zoom(e, f) {
  const r = canvas.getBoundingClientRect(), X = e.clientX - r.left - W / 2, Y = e.clientY - r.top - H / 2;
  view.x += X / view.s * (1 - 1 / f); view.y -= Y / view.s * (1 - 1 / f); view.s *= f; plan();
}
canvas.addEventListener("pointermove", e => {
  if (drag) { view.x -= (e.clientX - drag[0]) / view.s; view.y += (e.clientY - drag[1]) / view.s; drag = [e.clientX, e.clientY]; plan(); return; }
  const r = canvas.getBoundingClientRect(), X = e.clientX - r.left, Y = e.clientY - r.top;
  let best = 14 * 14, found = null;
  const look = (p, what) => { for (let k = 0; k < p.t.length; k++) { const a = px(p.x[k]) - X, b = py(p.y[k]) - Y, q = a * a + b * b; if (q < best && (now === null || p.t[k] <= now * T)) { best = q; found = [p, k, what]; } } };
  if (show.tracks) D.tracks.forEach(p => look(p, "track"));
  if (show.truth) truth.forEach(p => look(p, "truth"));
  tip.style.display = found ? "block" : "none";
  if (!found) return;
  const [p, k, what] = found;
  tip.textContent = `${what} ${p.id}\n${(p.t[k] / T).toFixed(1)} s\neast ${(p.x[k] / L).toFixed(1)} m, north ${(p.y[k] / L).toFixed(1)} m` + (p.z ? `\nup ${(p.z[k] / L).toFixed(1)} m` : "") + (p.s ? `\n${D.statuses[p.s[k]]}, ${(p.v[k] / 10).toFixed(1)} m/s` : "");
  tip.style.left = Math.min(X + 14, W - 190) + "px"; tip.style.top = Math.max(Y - 30, 4) + "px";
});
canvas.addEventListener("pointerleave", () => tip.style.display = "none");
const thinned = [];
if (D.track_step > 1) thinned.push(`one track row in ${D.track_step} (of ${D.track_rows})`);
if (sensors.length && sensors[0].step > 1) thinned.push(`one detection in ${sensors[0].step}`);
$("plan-note").textContent = "North is up. Hover for a track; drag to move; double-click or Ctrl + wheel to zoom." + (thinned.length ? ` To keep the file small this picture shows ${thinned.join(" and ")}.` : "") + (D.tracks.length ? "" : " The tracker reported no track.");
drawn(plan); setTime(null);

// ---------- height
const high = [...D.tracks, ...truth].filter(p => p.z);
if (D.dimensions === 3 && high.length) {
  const by = (a, b, f) => [...truth.filter(p => p.z).map(p => ({x: p[a].map(f), y: p.z.map(v => v / L), colour: "#111", dash: "5 4", width: 1.6, label: truth.length < 5 ? "truth " + p.id : ""})),
    ...D.tracks.filter(p => p.z).slice(0, 300).map(p => ({x: p[a].map(f), y: p.z.map(v => v / L), colour: trackColour(p.id), width: 1.8, label: D.tracks.length < 5 ? "track " + p.id : ""}))];
  chart($("height"), {series: by("t", "z", v => v / T), yl: "up, m", x: [0, span], gap: 5, height: 220});
  chart($("side-e"), {series: by("x", "z", v => v / L).map(s => ({...s, label: ""})), yl: "up, m", xl: "east, m", title: "Seen from the south"});
  chart($("side-n"), {series: by("y", "z", v => v / L).map(s => ({...s, label: ""})), yl: "up, m", xl: "north, m", title: "Seen from the west"});
  $("height").append(make("p", {class: "note"}, `Up is above the horizontal plane through the site, which lies ${sig(D.summary.recording?.site?.height_m ?? 0, 5)} m above the WGS84 ellipsoid (not above mean sea level).`));
  $("height").append(key([["#111", "truth (dashed)", true], ["#2a7f9e", "tracks (a colour each)", true]]));
} else hide("height-section");

// ---------- score and errors
if (own) {
  const names = {gospa_rms_m: "GOSPA RMS, m", gospa_mean_m: "GOSPA mean, m", gospa_localisation_m: "… localisation, m", gospa_missed_m: "… missed targets, m", gospa_false_m: "… false tracks, m", ospa_mean_m: "OSPA mean, m",
    tracked_fraction: "part of the time tracked", position_rmse_m: "position RMSE, m", identity_switches: "identity switches", breaks: "breaks", false_track_s: "false-track seconds", nees_mean: `NEES mean (${D.dimensions} is right)`, nees_median: "NEES median", nees_in_band_95: "NEES inside its 95 % band"};
  $("scores").append(table([["what", "", true], ["tracks", "tracks"], ["empty", "empty tracker"]], Object.entries(names).map(([k, what]) => ({what, tracks: own[k], empty: none[k]}))));
  const targets = scores.filter(r => r.item === "target");
  const details = make("details", targets.length <= 12 ? {open: ""} : {}, make("summary", {}, `by target (${targets.length})`));
  details.append(table([["target", "target", true], ["tracked_fraction", "tracked"], ["position_rmse_m", "RMSE, m"], ["identity_switches", "switches"], ["breaks", "breaks"], ["track_ids", "tracks that held it"], ["nees_mean", "NEES mean"], ["nees_in_band_95", "NEES in 95 %"]], targets));
  $("scores").append(details);
  chart($("gospa"), {title: "GOSPA against time (the cut-off is what one miss and one false track cost together)", series: [{x: D.gospa.t.map(v => v / T), y: D.gospa.v.map(v => v / 100), colour: "#0b6aa2", label: "GOSPA, m"}], x: [0, span], y: [0, null], yl: "m", height: 170});
  const axes = ["east", "north", "up"];
  const paint = list => {
    $("errors").replaceChildren();
    for (const e of list) {
      const part = make("div", {}, make("h3", {}, `target ${e.id}`)), row = make("div", {class: "two"});
      part.append(row); $("errors").append(part);
      e.e.forEach((v, k) => {
        const cell = make("div"); row.append(cell);
        const x = e.t.map(w => w / T), s3 = e.s[k].map(w => 3 * w / 100), y = v.map(w => w / 100);
        const worst = Math.max(...y.map(Math.abs), ...s3.slice().sort((a, b) => a - b).slice(0, Math.ceil(0.9 * s3.length)), 0.1) * 1.1;
        chart(cell, {series: [{x, y, colour: "#c4452f", label: axes[k] + " error, m"}, {x, y: s3, colour: "#0b6aa2", opacity: 0.5, width: 1, label: "3σ, m"}, {x, y: s3.map(w => -w), colour: "#0b6aa2", opacity: 0.5, width: 1}], bands: [{x, lo: s3.map(w => -w), hi: s3, colour: "#0b6aa2", opacity: 0.13}], x: [0, span], y: [-worst, worst], gap: 2, yl: axes[k] + " error, m", height: 150});
      });
    }
  };
  if (!D.errors.length) $("errors").append(make("p", {class: "note"}, "No target was ever held by a track, so there is no error to show."));
  else if (D.errors.length <= 4) paint(D.errors);
  else {
    const pick = make("select", {"aria-label": "Target"});
    D.errors.forEach((e, i) => pick.append(make("option", {value: i}, e.id)));
    pick.addEventListener("change", () => paint([D.errors[+pick.value]]));
    $("error-pick").append(make("span", {}, "target"), pick);
    paint(D.errors.slice(0, 2));
  }
} else {
  hide("error-section");
  $("scores").append(make("p", {class: "note"}, sensors.length ? "This recording has no truth, so the tracks cannot be scored." : "This report was made without its recording: no detections, no truth. Give it with: boresight report OUT REC"));
}

// ---------- timeline
(() => {
  const most = 300, all = D.tracks.slice().sort((a, b) => a.t[0] - b.t[0] || a.id - b.id);
  let rows = all;
  if (all.length > most) { const keep = new Set(all.slice().sort((a, b) => (b.t[b.t.length - 1] - b.t[0]) - (a.t[a.t.length - 1] - a.t[0])).slice(0, most)); rows = all.filter(p => keep.has(p)); }
  const box = make("div", {class: "chart"});
  const held = (D.held || []).slice(0, 60);
  if (!rows.length) $("timeline").append(make("p", {class: "note"}, "The tracker reported no track."));
  $("timeline").append(box);
  drawn(() => {
    const W = Math.max(box.clientWidth, 260), rh = rows.length <= 40 ? 15 : Math.max(2.2, 620 / rows.length), names = rows.length <= 40, l = 64, th = 15;
    const H = held.length * th + (held.length ? 10 : 0) + rows.length * rh + 24, X = v => l + Math.min(v, span) / span * (W - l - 10);
    const s = svg("svg", {viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": "Tracks in time"});
    for (const v of steps(0, span, W / 90)) { s.append(svg("line", {x1: X(v), x2: X(v), y1: 0, y2: H - 20, stroke: "#edf0f4"})); s.append(svg("text", {x: X(v), y: H - 6, "text-anchor": "middle"}, sig(v) + " s")); }
    held.forEach((h, i) => {
      const p = truth.find(q => q.id === h.id); if (!p || !p.t.length) return;
      const y = i * th, x = X(Math.max(0, p.t[0] / T)), w = X(Math.min(span, p.t[p.t.length - 1] / T)) - x;
      s.append(svg("rect", {x, y: y + 4, width: Math.max(w, 1), height: 5, fill: "#111"}));
      s.append(svg("text", {x: l - 6, y: y + 11, "text-anchor": "end"}, h.id.length > 10 ? h.id.slice(0, 9) + "…" : h.id));
      const bar = s.lastChild; bar.append(svg("title", {}, `target ${h.id}: held by ${h.tracks.length ? "track " + h.tracks.join(", then ") : "no track"}`));
    });
    const top = held.length ? held.length * th + 10 : 0;
    rows.forEach((p, i) => {
      const y = top + i * rh;
      if (names) s.append(svg("text", {x: l - 6, y: y + rh * 0.75, "text-anchor": "end", style: `fill:${trackColour(p.id)};font-weight:600`}, p.id));
      for (const [a, b] of pieces(p.t, gapOf(p))) for (let k = a; k < b;) {
        let j = k; while (j + 1 < b && p.s[j + 1] === p.s[k]) j++;
        const to = j + 1 < b ? p.t[j + 1] : p.t[j], x = X(p.t[k] / T);
        const r = svg("rect", {x: x.toFixed(1), y: (y + rh * 0.15).toFixed(1), width: Math.max(X(to / T) - x, 1).toFixed(1), height: (rh * 0.7).toFixed(1), fill: STATUS[D.statuses[p.s[k]]]});
        r.append(svg("title", {}, `track ${p.id}: ${D.statuses[p.s[k]]}, ${(p.t[k] / T).toFixed(1)}–${(to / T).toFixed(1)} s`));
        s.append(r); k = j + 1;
      }
    });
    box.replaceChildren(s);
  });
  $("timeline").append(key([...(held.length ? [["#111", "targets (truth)", true]] : []), ...Object.entries(STATUS).map(([w, c]) => [c, w, true])]));
  const words = [];
  if (all.length > most) words.push(`the ${most} longest of ${all.length} tracks`);
  if ((D.held || []).length > held.length) words.push(`the first ${held.length} of ${D.held.length} targets`);
  if (words.length) $("timeline").append(make("p", {class: "note"}, "Shown: " + words.join(", ") + "."));
})();

// ---------- consistency
(() => {
  const list = [];
  if (D.nees && D.nees.t.length) list.push(["NEES of all targets, per dimension", D.nees, "#111", own]);
  (D.nis || []).forEach((n, i) => { if (n.t.length) list.push([`NIS of ${n.id}, per component`, n, sensorColour(i), scores.find(r => r.item === "sensor" && r.sensor === n.id)]); });
  if (!list.length) return hide("nis-section");
  for (const [title, n, colour, row] of list) {
    const cell = make("div"); $("nis").append(cell);
    const mean = row ? (row.item === "sensor" ? row.nis_per_dof : row.nees_mean / D.dimensions) : null, part = row ? (row.item === "sensor" ? row.nis_in_band_95 : row.nees_in_band_95) : null;
    const top = Math.max(2.2, ...n.v.slice().sort((a, b) => a - b).slice(0, Math.ceil(0.95 * n.v.length)).map(v => 1.15 * v), ...n.hi.slice().sort((a, b) => a - b).slice(0, Math.ceil(n.hi.length / 2)));
    chart(cell, {title: title + (mean === null ? "" : `: mean ${sig(mean, 3)}, ${sig(100 * part, 3)} % in the single 95 % band`), series: [{x: n.t, y: n.v, colour, label: "mean"}], bands: [{x: n.t, lo: n.lo, hi: n.hi, colour: "#2f7d4f", opacity: 0.16}], lines: [1], x: [0, span], y: [0, top], gap: 3.5 * n.w, height: 150});
  }
})();

// ---------- registration
(() => {
  if (!(D.registration || []).length) return hide("registration-section");
  for (const r of D.registration) {
    const cell = make("div"), last = r.v.length - 1; $("registration").append(cell);
    const lo = r.v.map((v, i) => v - 2 * r.s[i]), hi = r.v.map((v, i) => v + 2 * r.s[i]);
    chart(cell, {title: `${r.id.replaceAll("_", " ")}: ${sig(r.v[last], 3)} ± ${sig(2 * r.s[last], 2)}, ${r.verdict}`, series: [{x: r.t, y: r.v, colour: "#0b6aa2", label: "estimate"}], bands: [{x: r.t, lo, hi, colour: "#0b6aa2", opacity: 0.16}], lines: [0], x: [0, span], y: [Math.min(-2 * r.declared, ...lo), Math.max(2 * r.declared, ...hi)], height: 150});
  }
})();

// ---------- fates
(() => {
  const names = [...new Set(D.outcome.map(r => r.sensor))], seen = D.fates.filter(f => D.outcome.some(r => r.fate === f));
  const bars = make("div", {class: "bars"});
  for (const n of names) {
    const mine = D.outcome.filter(r => r.sensor === n), total = mine.reduce((a, r) => a + r.rows, 0), stack = make("div", {class: "stack", role: "img", "aria-label": `fates of ${n}`});
    for (const f of seen) { const c = mine.filter(r => r.fate === f).reduce((a, r) => a + r.rows, 0); if (c) stack.append(make("i", {style: `width:${100 * c / total}%;background:${FATE[f] || "#888"}`, title: `${f}: ${c} of ${total}`})); }
    bars.append(make("span", {}, n), stack);
  }
  $("fates").append(bars, key(seen.map(f => [FATE[f] || "#888", f.replaceAll("_", " "), true])));
  const wide = names.map(n => { const r = {sensor: n}; let all = 0; for (const o of D.outcome) if (o.sensor === n) { r[o.fate] = (r[o.fate] || 0) + o.rows; all += o.rows; } seen.forEach(f => r[f] ??= 0); r.all = all; return r; });
  $("fates").append(table([["sensor", "sensor", true], ["all", "reports"], ...seen.map(f => [f, f.replaceAll("_", " ")])], wide));
  const why = D.outcome.filter(r => r.reason);
  for (const r of D.summary.lost || []) $("fates").append(make("p", {class: "note"}, `${r.sensor}: ${r.reports} of ${r.of} reports not used (${r.fate.replaceAll("_", " ")}): ${r.reason}`));
  for (const line of D.notes || []) $("fates").append(make("p", {class: "note"}, line));
  if (why.length) $("fates").append(make("details", {}, make("summary", {}, "reasons"), table([["sensor", "sensor", true], ["fate", "fate", true], ["reason", "reason", true], ["rows", "reports"]], why)));
})();

// ---------- sensors
if (D.inventory) {
  const rows = D.inventory.filter(r => r.item === "sensor");
  $("sensors").append(table([["id", "sensor", true], ["kind", "kind", true], ["platform", "platform", true], ["looks", "looks"], ["empty_looks", "empty"], ["detections", "detections"], ["detections_per_look", "per look"], ["median_period_s", "period, s"], ["longest_gap_s", "longest gap, s"], ["latency_s", "declared delay, s"], ["mean_arrival_delay_s", "stamp to arrival, s"], ["out_of_order", "out of order"], ["refused", "refused"], ["duplicates", "duplicates"]], rows));
  const ranges = rows.flatMap(r => Object.entries(r.measured || {}).map(([column, [least, largest]]) => ({id: r.id, column, least, largest, axes: r.axes})));
  if (ranges.length) $("sensors").append(make("details", {}, make("summary", {}, "ranges of what was measured"), table([["id", "sensor", true], ["column", "column", true], ["least", "least"], ["largest", "largest"], ["axes", "axes", true]], ranges)));
  for (const r of (D.inventory || []).filter(r => r.farthest_m != null)) $("sensors").append(make("p", {class: "note"}, `${r.item} ${r.id}: ${sig(r.nearest_m / 1e3, 4)} to ${sig(r.farthest_m / 1e3, 4)} km from the site`));
  const box = make("div", {class: "chart"});
  $("looks").append(make("h3", {}, "Reports in time (darker is more; white is a gap)"), box);
  drawn(() => {
    const W = Math.max(box.clientWidth, 260), l = 64, rh = 20, H = D.looks.length * rh + 22, X = v => l + v / span * (W - l - 10);
    const s = svg("svg", {viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": "Reports in time"});
    D.looks.forEach((q, i) => {
      const most = Math.max(...q.n, 1), w = (W - l - 10) / q.n.length;
      s.append(svg("text", {x: l - 6, y: i * rh + 14, "text-anchor": "end"}, q.id.length > 10 ? q.id.slice(0, 9) + "…" : q.id));
      q.n.forEach((c, k) => { if (c) { const r = svg("rect", {x: (l + k * w).toFixed(2), y: i * rh + 3, width: (w + 0.3).toFixed(2), height: rh - 6, fill: sensorColour(i), opacity: (0.15 + 0.85 * c / most).toFixed(2)}); s.append(r); } });
    });
    for (const v of steps(0, span, W / 90)) s.append(svg("text", {x: X(v), y: H - 5, "text-anchor": "middle"}, sig(v) + " s"));
    box.replaceChildren(s);
  });
} else hide("sensor-section");

// ---------- how to repeat
$("command").textContent = D.command || "boresight track REC -o OUT";
const flat = [];
(function walk(o, at) {
  for (const [k, v] of Object.entries(o || {})) {
    const name = at + (v && v.id ? v.id : k);
    if (v && typeof v === "object" && (!Array.isArray(v) || typeof v[0] === "object")) walk(v, name + ".");
    else if (k !== "id") flat.push({key: name, value: v});
  }
})({parameters: D.summary.parameters, versions: D.summary.versions, window_s: D.summary.window_s, config_file: D.summary.config_file, seconds: D.summary.seconds}, "");
$("parameters").append(make("details", {}, make("summary", {}, "parameters and versions"), table([["key", "key", true], ["value", "value", true]], flat)));
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach(d => d.open = true));
})();
