// The fleet in time: a row for each vehicle from take-off to landing. An arrival is dragged along its row, for its time, or to
// another row, for its turn; arrow keys do the same. The server plans the sequence on release.
import { button, byId, el, refill } from './dom.js';
import { known, on, worded } from './hub.js';
import { MOST_SHOWN, choose, many, toneOf } from './fleet.js';
import { change } from './link.js';
import { goTo } from './map.js';
import { showAt } from './replaybar.js';
import { markPlace } from './shapes.js';

const REST_MS = 700; // after this long without an arrow key an arrival counts as dropped
const ROW_PX = 28, ROLL_MS = 90;
let box = null, whole = false, held = null, timer = 0, now = null;

export function startTimeline() {
  box = byId('time-rows');
  on('plan', draw);
  on('state', (state) => { if (state.stage !== 'mission' || !many()) draw(null); else if (box.children.length) paint(); });
  for (const kind of ['path', 'refused', 'asked']) on(kind, () => box.classList.add('old'));
  on('unsent', draw);
  on('error', (message) => { if (message.code === 'bad_change') draw(); }); // the arrival goes back
  on('replayed', (shown) => { now = shown && shown.t; cursor(); });
}

const fleet = () => (known.plan && known.plan.fleet && many() ? known.plan.fleet : null);

function draw() {
  held = null;
  clearTimeout(timer);
  box.classList.remove('old');
  paint();
}

// The turn of each name in the order of arrival; turns of vehicles that are left out stay empty.
function order() {
  const given = known.state.arrival && known.state.arrival.order;
  if (Array.isArray(given)) return given;
  const names = known.state.vehicles.map((v) => v.name);
  return given === 'best' ? [...fleet().rows.map((r) => r.name), ...names.filter((name) => !fleet().rows.some((r) => r.name === name))] : names;
}

// The part of time that is shown: all flights, or the arrivals alone.
function span(rows) {
  if (whole) return [0, 1.03 * fleet().end_s];
  const ends = rows.flatMap((r) => [r.arrive_s, ...(r.window_s || [])]), from = Math.min(...ends), to = Math.max(...ends), room = Math.max(20, 0.35 * (to - from));
  return [Math.max(0, from - room), to + room];
}

// A time that is to be seen is in the part that is shown.
function seen(t) {
  const [from, to] = span(fleet().rows);
  if (t >= from && t <= to) return;
  whole = true;
  paint();
}

function paint() {
  const found = fleet();
  byId('time').hidden = !found && byId('replay-box').hidden;
  if (!found) { refill(box); return; }
  const rows = held ? held.rows : found.rows, [from, to] = held ? held.span : span(rows), part = (t) => (100 * (t - from)) / (to - from);
  const out = known.plan.left_out.map((l) => el('li', { class: 'left' }, el('b', {}, l.name), el('span', { class: 'bad' }, `left out: ${l.message}`)));
  refill(box, head(found), el('ol', { class: 'lanes', 'aria-label': 'Vehicles in the order of arrival' }, ...rows.map((r, i) => lane(r, i, rows, part)), ...out), axis(from, to, part));
  cursor();
}

function head(found) {
  const apart = found.separation, closest = apart && apart.closest;
  return el('div', { class: 'head' },
    el('p', { class: apart && !apart.safe ? 'bad' : null, role: 'status' }, `${apart ? apart.text : ''}${found.required || !apart || apart.safe ? '' : ' No rule keeps them apart: choose one under Arrival.'}`),
    closest ? button('Closest approach', () => { seen(closest.time_s); goTo(closest.at); markPlace(closest.at, least(closest.distance_m, 1, known.state.units.kinds.distance), apart.safe ? 'tight' : 'broken'); showAt(closest.time_s); }, { id: 'time-closest', title: 'Show the moment and the place' }) : null,
    button(whole ? 'Arrivals' : 'Whole flights', () => { whole = !whole; paint(); }, { id: 'time-zoom' }));
}

function lane(r, i, rows, part) {
  const mine = r.vehicle === known.state.vehicle, goal = `${part(r.arrive_s)}%`, words = wordsOf(r, i, rows), moves = movable(found_mode());
  const track = el('div', { class: 'lane' },
    bar('flight', part(r.depart_s), part(r.end_s)), r.window_s ? bar('wind', part(r.window_s[0]), part(r.window_s[1])) : null, el('i', { class: 'now', hidden: true }));
  const grip = el('button', {
    type: 'button', class: 'arrive', id: `arrive-${r.vehicle}`, role: 'slider', 'aria-label': `Arrival of ${r.name}`, 'aria-valuenow': Math.round(r.arrive_s), 'aria-valuemin': 0, 'aria-valuemax': 86400, 'aria-valuetext': words,
    title: words, 'aria-disabled': moves ? null : 'true', onpointerdown: (event) => press(event, r, track), onkeydown: (event) => key(event, r), onblur: settle,
  });
  grip.style.left = goal;
  track.append(grip);
  return el('li', { class: `${toneOf(r.vehicle)}${mine ? ' chosen' : ''}` }, button(r.name, () => choose(r.vehicle), { id: `lane-${r.vehicle}`, class: 'item', 'aria-pressed': String(mine) }), track, el('span', { class: 'at' }, duration(r.arrive_s)));
}

const found_mode = () => (known.state.arrival ? fleet().mode : 'none');
const movable = (mode) => mode === 'sequence' || mode === 'together';

function bar(kind, from, to) {
  const made = el('i', { class: kind });
  made.style.left = `${from}%`;
  made.style.width = `${Math.max(0, to - from)}%`;
  return made;
}

function wordsOf(r, i, rows) {
  const parts = [`at its goal ${duration(r.arrive_s, 1)}`];
  if (i > 0) parts.push(`${num(r.arrive_s - rows[i - 1].arrive_s, 1, 's')} after ${rows[i - 1].name}`);
  if (r.window_s) parts.push(`in the declared winds ${duration(r.window_s[0], 0)} to ${duration(r.window_s[1], 0)}`);
  parts.push(`leaves ${duration(r.depart_s)}`, `at ${worded(r.speed_m_s, 1, 'speed')}`);
  if (r.hold_s) parts.push(`waits ${num(r.hold_s, 0, 's')} in the air`);
  parts.push(r.in_air ? 'stays in the air' : `on the ground ${duration(r.end_s)}`);
  if (r.nearest) parts.push(`nearest other: ${r.nearest.name}, ${least(r.nearest.distance_m, 1, known.state.units.kinds.distance)}`);
  return parts.join('; ');
}

function axis(from, to, part) {
  const most = Math.max(2, Math.min(8, Math.floor((byId('time').clientWidth - 180) / 90)));
  const step = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400].find((s) => s >= (to - from) / most) || 28800, ticks = [];
  for (let t = Math.ceil(from / step) * step; t <= to; t += step) {
    if (part(t) < 4 || part(t) > 96) continue; // its words would be cut
    const tick = el('span', {}, duration(t));
    tick.style.left = `${part(t)}%`;
    ticks.push(tick);
  }
  return el('div', { class: 'axis', 'aria-hidden': 'true' }, el('div', { class: 'lane' }, ...ticks));
}

function cursor() {
  const found = fleet();
  if (!found) return;
  const [from, to] = held ? held.span : span(found.rows), there = now !== null && now >= from && now <= to;
  for (const line of box.querySelectorAll('.now')) { line.hidden = !there; line.style.left = `${(100 * (now - from)) / (to - from)}%`; }
}

// -- dragging ---------------------------------------------------------------------------------------------------------

// `held`: the rows as they would be, the changes that make them so, and the time that is shown meanwhile.
function hold(r) {
  if (!held || held.name !== r.name) held = { name: r.name, rows: fleet().rows, span: span(fleet().rows), changes: null };
}

// One arrival at another time: the first of a sequence takes all along, a later one sets the time between them.
function shift(r, t) {
  const { rows } = fleet(), mode = fleet().mode, turn = order().indexOf(r.name), turns = (row) => order().indexOf(row.name);
  if (mode === 'together' || turn === 0) {
    const arrive_s = Math.max(1, Math.round(t)), by = arrive_s - r.arrive_s;
    held.changes = { 'arrival.arrive_s': arrive_s };
    held.rows = rows.map((row) => ({ ...row, arrive_s: row.arrive_s + by }));
    held.words = `${mode === 'together' ? 'All arrive' : 'The first arrives'} ${duration(arrive_s)} after the start`;
  } else {
    const first = r.arrive_s - turn * fleet().interval_s, interval_s = Math.max(0, Math.round((t - first) / turn));
    held.changes = { 'arrival.interval_s': interval_s };
    held.rows = rows.map((row) => ({ ...row, arrive_s: first + turns(row) * interval_s }));
    held.words = `${interval_s} s from one arrival to the next`;
  }
}

// One vehicle at the turn of another.
function turnTo(r, other) {
  const names = order().filter((name) => name !== r.name), down = order().indexOf(other.name) > order().indexOf(r.name);
  names.splice(names.indexOf(other.name) + (down ? 1 : 0), 0, r.name);
  held.changes = { 'arrival.order': names };
  const times = fleet().rows.map((row) => row.arrive_s), moved = [...fleet().rows].sort((a, b) => names.indexOf(a.name) - names.indexOf(b.name));
  held.rows = moved.map((row, i) => ({ ...row, arrive_s: times[i], window_s: null }));
  held.words = names.length > MOST_SHOWN ? `${r.name} arrives as number ${names.indexOf(r.name) + 1} of ${names.length}` : `The order: ${names.join(', ')}`;
}

function press(event, r, track) {
  if (event.button !== 0 || !movable(found_mode())) return;
  event.preventDefault();
  const grip = event.currentTarget, lanes = grip.closest('.lanes'), from = lanes.scrollTop, at = [event.clientX, event.clientY], wide = track.getBoundingClientRect().width, rows = fleet().rows, mine = rows.findIndex((row) => row.name === r.name);
  grip.focus({ preventScroll: true });
  let going = false, last = null;
  // While another turn is sought beyond the rows that are in sight, they come into it.
  const roll = setInterval(() => {
    const { top, bottom } = lanes.getBoundingClientRect(), y = last ? last.clientY : at[1];
    if (!going || Math.abs(y - at[1]) < ROW_PX) return;
    lanes.scrollTop += y > bottom - ROW_PX ? ROW_PX : y < top + ROW_PX ? -ROW_PX : 0;
    move(last);
  }, ROLL_MS);
  const move = (e) => {
    last = e;
    const dx = e.clientX - at[0], dy = e.clientY - at[1];
    if (!going && Math.hypot(dx, dy) < 4) return;
    going = true;
    hold(r);
    const row = Math.max(0, Math.min(rows.length - 1, mine + Math.round((dy + lanes.scrollTop - from) / ROW_PX)));
    if (row !== mine && fleet().mode === 'sequence') turnTo(r, rows[row]);
    else shift(r, r.arrive_s + (dx / wide) * (held.span[1] - held.span[0]));
    preview();
  };
  const end = (e) => {
    clearInterval(roll);
    for (const [kind, call] of heard) window.removeEventListener(kind, call, true);
    if (!going) { choose(r.vehicle); return; }
    if (e.type === 'pointerup') drop(); else back();
  };
  const escape = (e) => { if (e.key === 'Escape') { e.stopPropagation(); end(e); } };
  const heard = [['pointermove', move], ['pointerup', end], ['pointercancel', end], ['keydown', escape]];
  for (const [kind, call] of heard) window.addEventListener(kind, call, true);
}

// Shows what would be, without new elements: the one that is held keeps its pointer.
function preview() {
  const [from, to] = held.span, lanes = box.querySelector('.lanes'), rows = new Map(held.rows.map((row, i) => [row.vehicle, [row, i]]));
  for (const li of lanes.children) {
    const grip = li.querySelector('.arrive'), found = grip && rows.get(Number(grip.id.slice(7)));
    if (!found) continue;
    li.style.order = found[1];
    grip.style.left = `${(100 * (found[0].arrive_s - from)) / (to - from)}%`;
    grip.setAttribute('aria-valuetext', held.words);
    li.querySelector('.at').textContent = duration(found[0].arrive_s);
  }
  box.querySelector('.head p').textContent = held.words;
}

function key(event, r) {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key], turn = { ArrowUp: -1, ArrowDown: 1 }[event.key];
  if (!movable(found_mode()) || event.ctrlKey || event.altKey || event.metaKey) return;
  if (step) {
    hold(r);
    const here = held.rows.find((row) => row.name === r.name).arrive_s, by = order().indexOf(r.name) || 1;
    shift(r, here + step * (event.shiftKey ? 10 : 1) * (fleet().mode === 'together' ? 1 : by));
    preview();
    clearTimeout(timer);
    timer = setTimeout(settle, REST_MS);
  } else if (turn && fleet().mode === 'sequence') {
    const { rows } = fleet(), other = rows[rows.findIndex((row) => row.name === r.name) + turn];
    if (other) { hold(r); turnTo(r, other); drop(); }
  } else if (event.key === 'Escape' && held) back();
  else if (event.key === 'Enter') settle();
  else return;
  event.preventDefault();
  event.stopPropagation();
}

const settle = () => { if (timer && held) drop(); };

function drop() {
  clearTimeout(timer);
  timer = 0;
  const { changes } = held;
  box.classList.add('old');
  change(changes);
}

function back() {
  clearTimeout(timer);
  timer = 0;
  held = null;
  paint();
}
