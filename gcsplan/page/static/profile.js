// The profile along the path: ground, limits, path. A pointer here marks the place on the map, and one there marks it here.
import { button, byId, degrees, el, refill, svg } from './dom.js';
import { known, on, tell, worded } from './hub.js';
import { choose, toneOf } from './fleet.js';
import { canvas, frame, pixel } from './map.js';
import { pointed } from './shapes.js';
import { holding } from './grips.js';

const ALL = 10000, NEAR_PX = 14;
const MOST_PROFILES = 12; // of more vehicles the server sends the chosen one's profile alone
let shown = null, vehicle = -1, at = -1, flown = [], plot = null, cursor = null, range = null, own = 0;

export function startProfile() {
  on('judged', draw);
  on('profile', ({ vehicle: number, profile }) => { // of many vehicles it comes once one is chosen
    const one = known.plan && known.plan.vehicles.find((v) => v.vehicle === number);
    if (!one || !shown) return;
    one.profile = profile;
    const old = byId('below').classList.contains('old');
    draw(known.plan);
    byId('below').classList.toggle('old', old);
  });
  on('file profile', draw); // a dropped file's, or the mission's again
  on('state', (state) => {
    if (state.stage !== 'mission' || !byId('below').children.length) draw(null);
    byId('below').hidden = state.stage === 'empty';
    if (shown && state.vehicle !== vehicle && known.plan) { const old = byId('below').classList.contains('old'); draw(known.plan); byId('below').classList.toggle('old', old); }
  });
  on('replayed', (now) => { flown = now ? now.spots : []; showFlown(); });
  let scheduled = null;
  frame().addEventListener('pointermove', (event) => {
    if (!scheduled) requestAnimationFrame(() => { const e = scheduled; scheduled = null; overMap(e); });
    scheduled = event;
  });
  frame().addEventListener('pointerleave', () => point(-1));
}

function draw(plan) {
  const box = byId('below');
  at = -1;
  hideTip();
  pointed(null);
  const flights = plan ? plan.vehicles.filter((v) => v.profile && v.profile.distance_m.length > 1) : [], all = plan && plan.vehicles.length > MOST_PROFILES ? plan.vehicles : flights;
  shown = null;
  if (!flights.length) { box.replaceChildren(el('p', { class: 'note' }, 'The profile along the path appears with the first mission.')); return; }
  box.classList.remove('old');
  vehicle = known.state.vehicle;
  const one = flights.find((v) => v.vehicle === vehicle) || flights[0];
  shown = one.profile;
  const choice = all.length > 1 ? el('select', { id: 'profile-of', 'aria-label': 'Profile of', onchange: (event) => choose(Number(event.target.value)) },
    ...all.map((v) => el('option', { value: v.vehicle, selected: v === one }, v.name))) : null;
  refill(box, choice, chart(shown, one.vehicle < 0 ? 't3' : toneOf(one.vehicle), one.marks || []));
  own = one.vehicle;
  showFlown();
}

// The vehicle of the replay, on its path.
function showFlown() {
  if (!shown || !plot) return;
  const spot = flown.find((s) => s.vehicle === own), dot = plot.querySelector('.craft');
  dot.setAttribute('d', spot && spot.along_m !== null ? `M${(ALL * spot.along_m) / range.end} ${(ALL * (range.y1 - spot.amsl_m)) / (range.y1 - range.y0)}h0` : '');
}

const line = (xs, ys) => {
  let text = '', pen = false;
  xs.forEach((x, i) => {
    if (ys[i] === null) { pen = false; return; }
    text += `${pen ? 'L' : 'M'}${x.toFixed(1)} ${ys[i].toFixed(1)}`;
    pen = true;
  });
  return text;
};

// Between two lines, where both are known.
function band(xs, low, high) {
  let text = '';
  for (let i = 0; i < xs.length;) {
    let j = i;
    while (j < xs.length && low[j] !== null && high[j] !== null) j += 1;
    if (j - i > 1) {
      const there = xs.slice(i, j).map((x, k) => `${x.toFixed(1)} ${high[i + k].toFixed(1)}`);
      const back = xs.slice(i, j).map((x, k) => `${x.toFixed(1)} ${low[i + k].toFixed(1)}`).reverse();
      text += `M${there.join('L')}L${back.join('L')}Z`;
    }
    i = Math.max(j, i + 1);
  }
  return text;
}

function chart(p, tone, marks) {
  const end = p.distance_m[p.distance_m.length - 1] || 1, heights = [...p.ground_m, ...p.path_m, ...p.lowest_m].filter((v) => v !== null);
  const low = Math.min(...heights), high = Math.max(...heights, ...near(p, heights)), room = 0.06 * (high - low) || 10;
  range = { end, y0: low - room, y1: high + room };
  const y = (v) => (v === null ? null : (ALL * (range.y1 - v)) / (range.y1 - range.y0)), ys = (list) => list.map(y);
  const xs = p.distance_m.map((d) => (ALL * d) / end), top = xs.map(() => 0), floor = xs.map(() => ALL);
  const shapes = [
    ['above', band(xs, ys(p.highest_m), top)], ['below', band(xs, ys(p.ground_m), ys(p.lowest_m))], ['ground', band(xs, floor, ys(p.ground_m))],
    ['ceiling', line(xs, ys(p.highest_m))], ['floor', line(xs, ys(p.lowest_m))], ['casing', line(xs, ys(p.path_m))], [`track ${tone}`, line(xs, ys(p.path_m))], [`craft ${tone}`, ''],
  ].map(([kind, d]) => svg('path', { class: kind, d }));
  const far = known.state.units.kinds.far, height = known.state.units.kinds.amsl;
  cursor = svg('path', { class: 'cursor' });
  const grids = svg('g'), xticks = el('div', { class: 'xticks' }), yticks = el('div', { class: 'yticks' });
  for (const v of steps(0, end, far[1], 6)) {
    grids.append(svg('path', { class: 'grid', d: `M${(ALL * v) / end} 0V${ALL}` }));
    const tick = el('span', { class: v > 0.95 * end ? 'last' : null }, num(v / far[1], decimals(end, far[1], 6)));
    tick.style.left = `${(100 * v) / end}%`;
    xticks.append(tick);
  }
  for (const v of steps(range.y0, range.y1, height[1], 4)) {
    grids.append(svg('path', { class: 'grid y', d: `M0 ${y(v)}H${ALL}` }));
    const tick = el('span', {}, num(v / height[1], decimals(range.y1 - range.y0, height[1], 4)));
    tick.style.top = `${y(v) / (ALL / 100)}%`;
    yticks.append(tick);
  }
  plot = el('div', {
    class: 'view plot', tabindex: 0, role: 'slider', 'aria-label': 'Place along the path', 'aria-valuemin': 0, 'aria-valuemax': Math.round(end), 'aria-valuenow': 0,
    onpointermove: overPlot, onpointerdown: overPlot, onpointerleave: () => point(-1), onkeydown: key, onblur: () => point(-1),
  }, svg('svg', { viewBox: `0 0 ${ALL} ${ALL}`, preserveAspectRatio: 'none', 'aria-hidden': 'true' }, grids, ...shapes, cursor));
  return el('figure', { class: 'chart' }, el('div', { class: 'ylabel' }, height[0]), yticks, el('div', { class: 'along' }, ...marks.map((mark) => spot(mark, end))), plot, xticks,
    el('div', { class: 'foot' }, legend(p, tone), el('span', { class: 'xlabel' }, `along the path, ${far[0]}`)));
}

// A place along the path that the user can go to.
function spot(mark, end) {
  const made = button(String(mark.item), mark.go, { class: 'finding', 'aria-label': `Item ${mark.item}: ${mark.words}`, title: mark.words });
  made.style.left = `${(100 * mark.at_m) / end}%`;
  return made;
}

// The highest allowed, as far as it belongs in the picture.
const near = (p, heights) => {
  const most = Math.max(...heights), span = most - Math.min(...heights);
  return p.highest_m.filter((v) => v !== null && v < most + 0.5 * span + 20);
};

const stepOf = (span, unit, count) => unit * niceStep(span / unit / count);
const decimals = (span, unit, count) => Math.max(0, -Math.floor(Math.log10(niceStep(span / unit / count)) + 1e-9));
function steps(from, to, unit, count) {
  const step = stepOf(to - from, unit, count), made = [];
  for (let i = Math.ceil(from / step); i * step <= to; i++) made.push(i * step);
  return made;
}

function legend(p, tone) {
  const item = (kind, words) => el('li', {}, el('i', { class: kind }), words), limit = (list) => list.some((v) => v !== null);
  return el('ul', { class: 'legend' }, item('swatch ground', 'ground'), limit(p.lowest_m) ? item('swatch below', 'too low') : null,
    limit(p.highest_m) ? item('swatch above', 'too high') : null, item(`stroke path ${tone}`, 'path'));
}

// -- the place that is pointed at -------------------------------------------------------------------------------------

function point(i, event) {
  at = i;
  if (!shown) return;
  tell('pointed', i < 0 ? null : [shown.lat[i], shown.lon[i]]);
  if (i < 0 || byId('below').classList.contains('old')) { pointed(null); cursor.setAttribute('d', ''); hideTip(); return; }
  pointed([shown.lat[i], shown.lon[i]]);
  cursor.setAttribute('d', `M${(ALL * shown.distance_m[i]) / range.end} 0V${ALL}`);
  const rows = rowsOf(i);
  plot.setAttribute('aria-valuenow', Math.round(shown.distance_m[i]));
  plot.setAttribute('aria-valuetext', rows.map((r) => r.join(' ')).join(', '));
  if (event) showTip(event, rows);
}

function rowsOf(i) {
  const path = shown.path_m[i], ground = shown.ground_m[i], rows = [['along the path', worded(shown.distance_m[i], 2, 'far')], ['path', worded(path, 1, 'amsl')]];
  const height = known.state.units.kinds.height;
  if (ground !== null) rows.push(['above ground', least(path - ground, 1, height)], ['ground', worded(ground, 1, 'amsl')]);
  if (shown.lowest_m[i] !== null) rows.push(['lowest allowed', worded(shown.lowest_m[i], 1, 'amsl')]);
  if (shown.highest_m[i] !== null) rows.push(['highest allowed', worded(shown.highest_m[i], 1, 'amsl')]);
  rows.push(['at', degrees([shown.lat[i], shown.lon[i]])]);
  return rows;
}

function overPlot(event) {
  const box = plot.getBoundingClientRect(), wanted = (range.end * (event.clientX - box.left)) / box.width, d = shown.distance_m;
  let low = 0, high = d.length - 1;
  while (high - low > 1) { const m = (low + high) >> 1; if (d[m] < wanted) low = m; else high = m; }
  point(wanted - d[low] < d[high] - wanted ? low : high, event);
}

function overMap(event) {
  if (!event || !shown || holding()) { if (at >= 0) point(-1); return; }
  const box = canvas().getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
  let best = NEAR_PX, found = -1;
  for (let i = 0; i < shown.lat.length; i++) {
    const [u, v] = pixel([shown.lat[i], shown.lon[i]]), away = Math.hypot(u - x, v - y);
    if (away < best) { best = away; found = i; }
  }
  if (found >= 0 || at >= 0) point(found, event);
}

function key(event) {
  const last = shown.lat.length - 1, page = Math.ceil(last / 20);
  const step = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: page, PageDown: -page, Home: -last, End: last }[event.key];
  if (event.key === 'Escape') point(-1);
  if (!step) return;
  event.preventDefault();
  const i = Math.max(0, Math.min(last, (at < 0 ? 0 : at) + step)), box = plot.getBoundingClientRect();
  point(i, { clientX: box.left + (box.width * shown.distance_m[i]) / range.end, clientY: box.top });
}

// -- the tip ----------------------------------------------------------------------------------------------------------

const hideTip = () => { byId('tip').hidden = true; };

function showTip(event, rows) {
  const box = byId('tip'), pad = 14;
  box.className = 'rows';
  box.replaceChildren(...rows.flatMap(([name, value]) => [el('span', {}, name), el('b', {}, value)]));
  box.hidden = false;
  const right = event.clientX + pad + box.offsetWidth < innerWidth - 4, under = event.clientY + pad + box.offsetHeight < innerHeight - 4;
  box.style.left = `${Math.max(4, right ? event.clientX + pad : event.clientX - pad - box.offsetWidth)}px`;
  box.style.top = `${Math.max(4, under ? event.clientY + pad : event.clientY - pad - box.offsetHeight)}px`;
}
