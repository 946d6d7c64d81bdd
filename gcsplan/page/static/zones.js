// Zones: drawn as a circle by a drag or as a polygon by clicks, chosen, and changed at their grips.
import { button } from './dom.js';
import { known, on, tell } from './hub.js';
import { addGrip, holding, moveGrip, removeGrip } from './grips.js';
import { change, live, step } from './link.js';
import { halfWay, moved, pixel, placeAt, size } from './map.js';
import { addMode, leave, show } from './modes.js';
import { choose, sketch, zones } from './shapes.js';

const FEWEST_M = 1; // a circle that is smaller was a click, not a drag
let chosen = '', grips = [];

export const chosenZone = () => zones().map((f) => f.properties).find((z) => z.key === chosen && chosen !== '');

export function startZones() {
  addMode({ name: 'circle', hint: 'Press at the centre of the zone and drag to its edge.', press: pressCircle, click: clickCircle, leave: () => sketch(null) });
  let corners = [];
  const finish = () => {
    const ring = corners.filter((p, i) => i === 0 || apart(p, corners[i - 1]) > 3);
    if (ring.length > 2) add({ polygon: ring });
    leave();
  };
  addMode({
    name: 'polygon', enter: () => { corners = []; }, leave: () => { corners = []; sketch(null); }, finish,
    hint: () => (corners.length ? `${corners.length} corner${corners.length > 1 ? 's' : ''}: click the next, or the first one to finish.` : 'Click the corners of the zone, one after the other.'),
    click: (place) => {
      if (corners.length > 2 && apart(place, corners[0]) < 12) { finish(); return; }
      corners = [...corners, place];
      sketch({ polygon: corners });
      show();
    },
    buttons: () => (corners.length > 2 ? [button('Finish', finish, { id: 'finish', class: 'main' })] : []),
  });
  on('picked', (event) => select(event.target.dataset && event.target.dataset.key ? event.target.dataset.key : ''));
  on('state', () => { if (!holding()) redraw(); });
  on('error', (message) => { if (message.code === 'bad_change') redraw(); });
}

const apart = (a, b) => Math.hypot(pixel(a)[0] - pixel(b)[0], pixel(a)[1] - pixel(b)[1]);
const rounded = (m) => Math.max(FEWEST_M, Math.round(m));
const away = (centre, place) => rounded(apart(centre, place) * perPixel(centre));

// Metres of the ground in one pixel at a place.
function perPixel(place) {
  const [, lon] = place, [, next] = moved(place, 100, 0);
  return (Math.abs(next - lon) * 40075016.7 * Math.cos((place[0] * Math.PI) / 180)) / 360 / 100;
}

export function select(key) {
  chosen = key;
  redraw();
  tell('chosen', key);
}

// -- new ones ---------------------------------------------------------------------------------------------------------

// A new entry of a list of zones; its key.
export function add(shape, list = 'no_fly', word = 'zone') {
  const taken = new Set(zones().map((f) => f.properties.name));
  let number = 1;
  while (taken.has(`${word} ${number}`)) number += 1;
  const key = `${list}[${known.state.counts[list]}]`;
  sketch(null);
  chosen = key;
  change({ [key]: { name: `${word} ${number}`, ...shape } });
  tell('chosen', key);
  return key;
}

function pressCircle(event, centre) {
  let radius_m = 0;
  const move = (e) => {
    radius_m = away(centre, placeAt(e));
    sketch({ center: centre, radius_m });
  };
  const end = () => {
    window.removeEventListener('pointermove', move);
    for (const kind of ['pointerup', 'pointercancel']) window.removeEventListener(kind, end);
    if (radius_m / perPixel(centre) < 4) { sketch(null); return; }
    add({ center: centre, radius_m });
    leave();
  };
  window.addEventListener('pointermove', move);
  for (const kind of ['pointerup', 'pointercancel']) window.addEventListener(kind, end);
}

// Without a drag, by Enter on the map: a circle of an eighth of the map's width, to be changed at its grips.
function clickCircle(place, byKey) {
  if (!byKey) return;
  add({ center: place, radius_m: rounded((perPixel(place) * size()[0]) / 16) });
  leave();
}

// -- the chosen one ---------------------------------------------------------------------------------------------------

function redraw() {
  const zone = chosenZone(), focused = document.activeElement && document.activeElement.id;
  if (!zone && chosen && known.state) chosen = known.busy ? chosen : '';
  choose(zone ? zone.key : '');
  sketch(null);
  for (const grip of grips) removeGrip(grip);
  grips = zone && zone.editable ? (zone.shape === 'circle' ? ofCircle(zone) : ofPolygon(zone)) : [];
  const again = grips.find((grip) => grip.id === focused);
  if (again) again.made.focus({ preventScroll: true });
}

function cancel() {
  step({ type: 'cancel' });
  redraw();
}

const put = (call, shape) => (at) => {
  const [key, value, drawn] = shape(at);
  if (call === live) sketch(drawn);
  call({ [key]: value });
};
const grip = (id, kind, label, at, shape, remove) => addGrip({ id: `zone-${id}`, kind, label, at, live: put(live, shape), drop: put(change, shape), cancel, remove });

function ofCircle(zone) {
  const edge = (centre, radius_m) => moved(centre, radius_m / perPixel(centre), 0);
  const centre = grip('centre', 'corner', `centre of ${zone.name}; arrow keys move it`, zone.center, (at) => {
    moveGrip(rim, edge(at, zone.radius_m));
    return [`${zone.key}.center`, at, { center: at, radius_m: zone.radius_m }];
  }, () => remove(zone));
  const rim = grip('rim', 'corner rim', `edge of ${zone.name}; arrow keys make it larger or smaller`, edge(zone.center, zone.radius_m), (at) => {
    const radius_m = away(zone.center, at);
    return [`${zone.key}.radius_m`, radius_m, { center: zone.center, radius_m }];
  });
  return [centre, rim];
}

function ofPolygon(zone) {
  const ring = zone.polygon, made = [];
  const shape = (list) => [`${zone.key}.polygon`, list, { polygon: list }];
  ring.forEach((corner, i) => {
    const next = ring[(i + 1) % ring.length], half = halfWay(corner, next);
    made.push(grip(`corner-${i}`, 'corner', `corner ${i + 1} of ${zone.name}; arrow keys move it, Delete removes it`, corner,
      (at) => shape(ring.map((p, k) => (k === i ? at : p))),
      ring.length > 3 ? () => change({ [`${zone.key}.polygon`]: ring.filter((_, k) => k !== i) }) : null));
    made.push(grip(`half-${i}`, 'corner half', `new corner after corner ${i + 1} of ${zone.name}`, half,
      (at) => shape([...ring.slice(0, i + 1), at, ...ring.slice(i + 1)])));
  });
  return made;
}

export function remove(zone) {
  chosen = '';
  change({ [zone.key]: null });
  tell('chosen', '');
}
