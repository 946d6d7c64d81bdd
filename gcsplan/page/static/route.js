// Start, goal and vias of the vehicles: set by a click, dragged, inserted into the path, removed.
import { degrees } from './dom.js';
import { known, on } from './hub.js';
import { addGrip, grab, holding, moveGrip, removeGrip } from './grips.js';
import { MOST_SHOWN, choose, many, toneOf } from './fleet.js';
import { change, live, step } from './link.js';
import { canvas, frame, pixel, placeAt } from './map.js';
import { addMode, enter, leave, modeNow } from './modes.js';
import { lineOf } from './shapes.js';

let grips = [];

export function startRoute() {
  for (const [name, hint, next] of [['start', 'Click where the vehicle takes off.', 'goal'], ['goal', 'Click where it flies to.', '']]) {
    addMode({ name, hint, click: (place) => {
      leave();
      change({ [`vehicles[0].${name}`]: place });
      if (next && !known.state.vehicles[0].goal) enter(next);
    } });
  }
  addMode({ name: 'via', hint: 'Click a place that the path has to pass.', click: (place) => { leave(); insertVia(place); } });
  on('state', redraw);
  on('error', (message) => { if (message.code === 'bad_change') redraw(known.state); }); // the point goes back
  document.addEventListener('pointerdown', (event) => { if (event.target.classList?.contains('grasp') && event.pointerType !== 'touch' && !modeNow()) pull(event); }, true); // a finger moves the map
}

function cancel() {
  step({ type: 'cancel' });
  redraw(known.state);
}

export function changeVia(vehicle, list) {
  change({ [`${vehicle.key}.via`]: list.length ? list : null });
}

function wanted(state) {
  return state.vehicles.flatMap((vehicle, v) => {
    if (state.vehicles.length > MOST_SHOWN && v !== state.vehicle) return [];
    const whose = many() ? `${vehicle.name} ` : '', mine = { tone: toneOf(v), chosen: () => choose(v) };
    const single = (name) => vehicle[name] && {
      id: `grip-${v}-${name}`, kind: name, ...mine, words: whose + name, at: vehicle[name],
      live: (at) => live({ [`${vehicle.key}.${name}`]: at }), drop: (at) => change({ [`${vehicle.key}.${name}`]: at }),
    };
    const via = vehicle.via.map((place, i) => {
      const put = (at) => vehicle.via.map((other, k) => (k === i ? at : other));
      return {
        id: `grip-${v}-via-${i}`, kind: 'via', ...mine, words: `${i + 1}`, whose, at: place,
        live: (at) => live({ [`${vehicle.key}.via`]: put(at) }), drop: (at) => changeVia(vehicle, put(at)),
        remove: () => changeVia(vehicle, vehicle.via.filter((_, k) => k !== i)),
      };
    });
    return vehicle.editable ? [single('start'), ...via, single('goal')].filter((p) => p) : [];
  });
}

function redraw(state) {
  if (holding()) return;
  const next = wanted(state), focused = document.activeElement && document.activeElement.id;
  const same = next.length === grips.length && next.every((p, i) => p.id === grips[i].id);
  if (same) {
    grips.forEach((grip, i) => { Object.assign(grip, next[i], { cancel }); moveGrip(grip, next[i].at); name(grip); });
    return;
  }
  for (const grip of grips) removeGrip(grip);
  grips = next.map((p) => addGrip({ ...p, cancel, label: p.words }));
  grips.forEach(name);
  const again = grips.find((grip) => grip.id === focused);
  if (again) again.made.focus({ preventScroll: true });
}

function name(grip) {
  const what = grip.kind === 'via' ? `${grip.whose}via ${grip.words}` : grip.words;
  grip.made.setAttribute('aria-label', `${what} at ${degrees(grip.at)}; arrow keys move it${grip.remove ? ', Delete removes it' : ''}`);
}

// -- insertion --------------------------------------------------------------------------------------------------------

// How far along a drawn line, in legs, the spot nearest to a place is.
function along(line, place) {
  const [x, y] = pixel(place), spots = line.map(pixel);
  let best = Infinity, found = 0;
  for (let i = 0; i + 1 < spots.length; i++) {
    const [ax, ay] = spots[i], bx = spots[i + 1][0] - ax, by = spots[i + 1][1] - ay, long = bx * bx + by * by;
    const f = long ? Math.max(0, Math.min(1, ((x - ax) * bx + (y - ay) * by) / long)) : 0;
    const away = Math.hypot(ax + f * bx - x, ay + f * by - y);
    if (away < best - 1e-9) { best = away; found = i + f; }
  }
  return { where: found, away: best };
}

// The list of vias of the nearest vehicle with one more, in the order in which its path passes them.
function withVia(place) {
  const near = known.state.vehicles.map((vehicle, v) => ({ vehicle, v, ...along(lineOf(v), place) })).filter((n) => n.vehicle.editable)
    .sort((a, b) => a.away - b.away)[0];
  if (!near) return null;
  const before = near.vehicle.via.filter((via) => along(lineOf(near.v), via).where <= near.where).length;
  return { ...near, index: before, list: [...near.vehicle.via.slice(0, before), place, ...near.vehicle.via.slice(before)] };
}

function insertVia(place) {
  const made = withVia(place);
  if (made) changeVia(made.vehicle, made.list);
}

// A press on the path pulls a new via out of it.
function pull(event) {
  if (event.button !== 0) return;
  const place = placeAt(event), made = withVia(place);
  if (!made) return;
  const put = (at) => made.list.map((other, k) => (k === made.index ? at : other));
  const grip = addGrip({
    id: 'grip-new', kind: 'via', label: 'new via', words: '', at: place,
    live: (at) => live({ [`${made.vehicle.key}.via`]: put(at) }),
    drop: (at) => { removeGrip(grip); changeVia(made.vehicle, put(at)); },
    cancel: () => { removeGrip(grip); cancel(); },
  });
  frame().addEventListener('mousedown', (e) => e.stopPropagation(), { capture: true, once: true });
  grab(grip, event);
  grip.made.addEventListener('pointerup', () => setTimeout(() => { if (grip.made.isConnected) { removeGrip(grip); canvas().focus({ preventScroll: true }); } }));
}
