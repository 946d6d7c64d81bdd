// The replay of the report, on the map, in the profile, in the time line and in space.
import { button, byId, el } from './dom.js';
import { on, tell } from './hub.js';
import { many, toneOf } from './fleet.js';
import { isReady, need } from './scenery.js';

const SPEEDS = [1, 2, 5, 10, 20, 30, 60], WATCH_S = 90; // it is over after that time
let open = false, again = null, wanted = null;

export function startReplayBar() {
  byId('show-replay').addEventListener('click', () => set(!open));
  on('scenery', refresh);
  on('dragged', hide);
  on('asked', hide);
}

// Opens the replay at a time.
export function showAt(t) {
  wanted = t;
  if (open && isReady()) refresh(); else set(true);
}

function set(yes) {
  open = yes;
  byId('show-replay').setAttribute('aria-pressed', String(yes));
  byId('replay-box').hidden = !yes;
  byId('time').hidden = !yes && !many();
  need('replay', yes);
  if (!yes) hide(); else if (isReady()) refresh();
}

function hide() {
  if (!again) return;
  byId('replay').querySelector('input').dispatchEvent(new Event('input')); // stops its clock
  moveTo(replay.t, false);
}

function refresh() {
  if (!open || !data.replay) return;
  if (!again) {
    byId('replay-box').replaceChildren(bar());
    rows();
    movers.push(follow);
    again = startReplay();
  } else { rows(); again(); }
  moveTo(wanted === null ? replay.t : wanted);
  wanted = null;
}

function bar() {
  const first = SPEEDS.find((s) => data.replay.end <= s * WATCH_S) || SPEEDS[SPEEDS.length - 1];
  return el('div', { class: 'replay', id: 'replay', role: 'group', 'aria-label': 'Replay' },
    button('▶', () => {}, { 'data-do': 'play', 'aria-label': 'play' }),
    el('label', {}, 'time ', el('input', { type: 'range', min: 0, max: 0, step: 1, value: 0 })), el('output', { 'aria-live': 'off' }, ''),
    el('label', {}, 'speed ', el('select', {}, ...SPEEDS.map((s) => el('option', { value: s, selected: s === first }, `${s}×`)))),
    el('details', {}, el('summary', {}, 'Every vehicle at this time'), el('div', { class: 'scroll' }, el('table', {}, el('thead', {}, el('tr')), el('tbody')))));
}

function rows() {
  const table = byId('replay').querySelector('table'), several = data.replay.tracks.length > 1;
  const heads = ['vehicle', 'is', 'AMSL', 'above ground', ...(several ? ['nearest other in the air'] : [])];
  table.querySelector('tr').replaceChildren(...heads.map((words) => el('th', { scope: 'col' }, words)));
  table.querySelector('tbody').replaceChildren(...data.replay.tracks.map((track) => el('tr', {}, el('th', { scope: 'row' }, el('i', { class: `swatch ${toneOf(track.k)}` }), track.name),
    ...heads.slice(1).map(() => el('td', {}, '')))));
}

// Where each vehicle is: for the map, the time line and the profile.
function follow() {
  if (!replay.shown || !open) { tell('replayed', null); return; }
  const spots = replay.tracks.map((track, i) => {
    const place = replay.places[i], line = data.lines.find((l) => l.index === track.k), [lat, lon] = place ? ground.degrees(place.e, place.n) : [NaN, NaN];
    if (!place || Number.isNaN(lat)) return null;
    return { vehicle: track.k, name: track.name, at: [lat, lon], amsl_m: place.z, along_m: line ? line.s[sampleAt(line, place, replay.t - track.begin)] : null };
  });
  tell('replayed', { t: replay.t, spots: spots.filter((spot) => spot) });
}
