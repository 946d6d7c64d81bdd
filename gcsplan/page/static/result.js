// The result: the verdict, the gap that counts down, the figures; or why there is no mission, and what would do.
import { button, byId, el } from './dom.js';
import { known, on, tell } from './hub.js';
import { MOST_SHOWN } from './fleet.js';
import { holding } from './grips.js';
import { change } from './link.js';
import { goTo } from './map.js';
import { agePath, clearPath, drawNoHome, drawPath, markPlace } from './shapes.js';

const LOOK = { safe: ['safe', '✓'], violations: ['unsafe', '✕'], 'not judged': ['unjudged', '?'] };
let box = null;
let shown = -1; // the vehicle whose details are shown
let current = null; // the plan that is shown as the verdict on the mission as it is now
let found = new Set(); // the vehicles of the newest mission that have a path
let before = []; // the answers of the newest mission: a change that is refused as a whole brings them back

export function startResult() {
  box = el('section', { id: 'result', 'aria-label': 'Result' },
    el('div', { class: 'verdict', id: 'verdict', role: 'status' }), el('div', { id: 'gap', hidden: true }), el('div', { id: 'rest' }));
  on('path', path);
  on('bound', (message) => showGap(message.gap_percent));
  on('plan', plan);
  on('interim', interim);
  on('home', home);
  on('refused', refused);
  on('asked', () => { current = null; found = new Set(); planning(); });
  on('dragged', (changes) => { if (current) { agePath(moved(changes)); follows(); } });
  on('error', (message) => {
    if (message.code === 'bad_mission') nothing(message.message, 'The mission has a mistake');
    if (['bad_change', 'bad_file', 'bad_text', 'file_exists'].includes(message.code)) for (const answer of before) ({ plan, home, refused, interim })[answer.type](answer);
  });
  on('connection', (now) => { if (now !== 'open') nothing('The result below may be old.', 'Not connected'); });
  on('state', (state) => {
    if (current && shown !== state.vehicle && current.vehicles.length > MOST_SHOWN) details(current);
    for (const one of box.querySelectorAll('#rest > [data-vehicle]')) one.open = Number(one.dataset.vehicle) === state.vehicle;
  });
  on('state', (state) => {
    if (state.stage === 'mission') { if (!known.plan) planning(); return; }
    clearPath();
    drawNoHome([]);
    markPlace(null);
    known.plan = null;
    tell('judged', null);
    byId('rest')?.replaceChildren();
    showGap(null);
    verdict('unjudged', '1', 'Start and goal', 'Click both on the map, or type them below.');
  });
  return box;
}

// The numbers of the vehicles that a drag moves; undefined for a zone, which is in the way of all.
function moved(changes) {
  const found = Object.keys(changes).map((key) => /^vehicles\[(\d+)\]/.exec(key));
  return found.every((f) => f) ? found.map((f) => Number(f[1])) : undefined;
}

const planning = () => verdict('unjudged', '…', 'Planning', 'The mission is planned and judged.');

function verdict(look, sign, word, words) {
  const made = byId('verdict') || box.querySelector('.verdict'), text = [look, word, words].join('\n');
  if (made.dataset.text === text) return; // a reader of the screen hears it once
  made.dataset.text = text;
  made.className = `verdict ${look}`;
  made.replaceChildren(el('span', { class: 'sign', 'aria-hidden': 'true' }, sign), el('div', {}, el('strong', {}, word), el('p', {}, words)));
}

function showGap(percent) {
  const made = box.querySelector('#gap');
  made.hidden = percent === null || percent === undefined;
  if (made.hidden) return;
  const text = `No path is more than ${num(percent, percent < 0.095 ? 2 : 1)}${'\u202f'}% shorter`;
  made.replaceChildren(el('span', {}, text), el('meter', { min: 0, max: 20, low: 1, optimum: 0, value: Math.min(20, percent), 'aria-label': 'Gap, percent' }));
}

function follows() {
  current = null;
  showGap(null);
  verdict('unjudged', '…', 'A path follows', 'It is not judged yet: release the point.');
}

function path(message) {
  current = null;
  drawPath(message.vehicle, message.line, 'draft');
  drawNoHome([]);
  markPlace(null);
  byId('below').classList.add('old');
  box.querySelector('#rest').classList.add('old');
  if (message.live || holding()) {
    follows();
  } else {
    found.add(message.vehicle);
    showGap(found.size > 1 ? null : message.gap_percent);
    if (known.state.vehicles.length > 1) verdict('unjudged', '…', 'Planning', `${found.size === 1 ? 'One new path is' : `${found.size} new paths are`} found. Arrival times and separation follow when all are.`);
    else verdict('unjudged', '…', 'A path is found', 'The bound tightens; the mission is not judged yet.');
  }
}

function plan(message) {
  current = message;
  before = [message];
  clearPath();
  for (const v of message.vehicles) {
    drawPath(v.vehicle, v.line, { safe: 'judged', violations: 'unsafe' }[v.verdict] || 'draft');
  }
  drawNoHome(message.vehicles.flatMap((v) => (v.way_home ? v.way_home.unsafe : [])));
  markPlace(null);
  judged(message, message.vehicles.map((v) => v.way_home), message.headline);
  showGap(null);
  details(message);
  tell('judged', message);
}

// Of more than a few vehicles, the chosen one and those that may not fly.
function details(message) {
  const rest = box.querySelector('#rest'), several = message.vehicles.length > 1, few = message.vehicles.length <= MOST_SHOWN;
  shown = known.state.vehicle;
  rest.classList.remove('old');
  rest.replaceChildren(...message.vehicles.filter((v) => few || v.vehicle === shown || v.verdict !== 'safe').flatMap((v) => ofVehicle(v, several)),
    ...[list('Left out', message.left_out.map((l) => `${l.name}: ${l.message}`), true), list('Notes on all', message.notes, false)].filter((p) => p));
}

// The path of the drag, judged: the search goes on.
function interim(message) {
  plan(message);
  showGap(message.vehicles[0].gap_percent);
}

// A mission is called safe with all its returns; before they are judged, or where one is unsafe, its path alone is.
function judged({ verdict: word, fleet }, homes, words) {
  const apart = fleet && fleet.separation;
  if (word === 'safe' && apart && !apart.safe) { verdict('unjudged', '!', 'paths safe, not apart', apart.text); return; }
  const [look, sign] = LOOK[word] || LOOK['not judged'], returns = homes.every((home) => home && home.safe === true);
  if (word !== 'safe' || returns) verdict(look, sign, word, words);
  else if (homes.some((home) => home && home.safe !== true)) verdict('unjudged', '!', 'path safe', words);
  else verdict(look, sign, 'path safe', words);
}

function ofVehicle(v, many) {
  const rows = v.figures.filter((f) => f.key !== 'verdict').map(figure);
  if (!v.way_home) rows.push(el('div', { 'data-home': v.vehicle }, el('dt', {}, 'Way home'), el('dd', {}, 'being judged')));
  const parts = [el('dl', {}, ...rows), list('Findings', v.findings, true), list('Not judged', v.not_judged, true), homeWords(v.vehicle, v.way_home), list('Notes', v.notes, false)].filter((p) => p);
  if (!many) return parts;
  return [el('details', { 'data-vehicle': v.vehicle, open: v.vehicle === known.state.vehicle }, el('summary', {}, `${v.name}: ${v.verdict === 'safe' ? 'path safe' : v.verdict}`), ...parts)];
}

const list = (name, items, open) => (items.length ? el('details', { open }, el('summary', {}, `${name} (${items.length})`), el('ul', {}, ...items.map((i) => el('li', {}, i)))) : null);

function figure(f) {
  return el('div', { class: f.bad ? 'bad' : null, 'data-key': f.key }, el('dt', {}, f.label),
    el('dd', {}, f.at ? button(f.text, () => { goTo(f.at); markPlace(f.at, f.label); }, { class: 'spot', title: 'Show the place on the map' }) : f.text));
}

// -- the way home: its judgement comes after the mission's ------------------------------------------------------------

const homeWords = (vehicle, way) => el('p', { class: `bare${way && way.unsafe.length ? ' bad' : ''}`, id: `home-${vehicle}`, hidden: !way || way.safe === true || !way.text }, way ? way.text : '');

function home(message) {
  if (!current || current.n !== message.n) return;
  before = [current, message];
  judged(current, current.vehicles.map((v) => message.vehicles.find((h) => h.vehicle === v.vehicle)?.way_home), message.headline);
  drawNoHome(message.vehicles.flatMap((v) => (v.way_home ? v.way_home.unsafe : [])));
  for (const v of message.vehicles) {
    const own = current.vehicles.find((o) => o.vehicle === v.vehicle);
    if (own && !own.way_home) { own.way_home = v.way_home; own.figures.push(v.figure); } // for the time when it is chosen
    const row = box.querySelector(`[data-home="${v.vehicle}"]`);
    if (row && v.figure) row.replaceWith(figure(v.figure)); else row?.remove();
    if (v.way_home) byId(`home-${v.vehicle}`)?.replaceWith(homeWords(v.vehicle, v.way_home));
  }
}

// -- no mission -------------------------------------------------------------------------------------------------------

function nothing(words, word) {
  current = null;
  agePath();
  drawNoHome([]);
  byId('below').classList.add('old');
  box.querySelector('#rest').classList.add('old');
  showGap(null);
  verdict('unsafe', '✕', word, words);
}

function refused(message) {
  if (!message.live) before = [message];
  nothing(message.message, message.live ? 'No path here' : 'No mission');
  markPlace(message.at, 'here');
  if (message.live) return;
  const rest = box.querySelector('#rest');
  rest.classList.remove('old');
  rest.replaceChildren(
    ...(message.at ? [el('p', {}, button('Show the place', () => goTo(message.at), { class: 'wide' }))] : []),
    ...(message.cures.length ? [el('h3', {}, 'These would do'), ...message.cures.map(cure)] : []),
    ...(message.attempts.length ? [el('h3', {}, 'These may do'), ...message.attempts.map(cure)] : []));
}

function cure(given) {
  return el('div', { class: 'cure' }, button(given.label, () => change(given.changes), { class: 'main' }));
}
