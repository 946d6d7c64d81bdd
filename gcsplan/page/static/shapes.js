// What lies over the ground: zones, the path, stretches without a way home. One SVG, moved as a whole with the map.
import { el, svg } from './dom.js';
import { known, on } from './hub.js';
import { MOST_SHOWN, many, toneOf } from './fleet.js';
import { frame, local, metres, pixel, size, transformation } from './map.js';

const d = (places, closed = false) => (places.length
  ? `M${places.map((p) => local(p).map((v) => v.toFixed(2)).join(' ')).join('L')}${closed ? 'Z' : ''}` : '');

const layers = {};
let whole = null, names = null, labels = [], mark = null, marked = null, crafts = null;

export function startShapes() {
  whole = svg('g', { transform: '' });
  for (const name of ['zones', 'sketch', 'nohome', 'casing', 'path', 'hit', 'pointed']) whole.append(layers[name] = svg('g', { class: name }));
  layers.pointed.append(svg('path', { class: 'cursor', id: 'pointed' }));
  names = el('div', { class: 'marks', 'aria-hidden': 'true' });
  mark = el('div', { class: 'mark broken', hidden: true }, el('b'));
  crafts = el('div', { class: 'crafts', 'aria-hidden': 'true' });
  frame().append(svg('svg', { class: 'shapes', 'aria-hidden': 'true' }, whole), names, mark, crafts);
  on('moved', follow);
  on('rested', layNames);
  on('replayed', drawCrafts);
  on('state', () => { whole.classList.toggle('crowd', crowd()); for (const [vehicle, track] of tracks) dress(vehicle, track); });
  on('state', (state) => { drawZones(state.zones.features); layNames(); follow(); });
}

function follow() {
  whole.setAttribute('transform', transformation());
  for (const label of labels) put(label.made, label.at);
  if (marked) put(mark, marked);
  for (const craft of flying) put(craft.made, craft.at);
}

function put(made, at) {
  const [x, y] = pixel(at);
  made.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
}

// -- zones ------------------------------------------------------------------------------------------------------------

const rings = ({ type, coordinates }) => (type === 'Polygon' ? [coordinates] : coordinates).flat().map((ring) => ring.map(([lon, lat]) => [lat, lon]));

function drawZones(features) {
  labels = [];
  names.replaceChildren();
  layers.zones.replaceChildren(...features.map((feature) => {
    const { name, levels, kind, key } = feature.properties, lines = rings(feature.geometry);
    const at = centre(lines[0]), made = el('div', { class: 'mark name' }, el('b', {}, name));
    names.append(made);
    labels.push({ made, at, ring: lines[0], name, full: levels ? `${name}\n${levels}` : name, sizes: [] });
    const shape = svg('path', {
      class: kind === 'keep_in' ? 'area' : 'zone', 'data-key': key, 'data-name': name, d: lines.map((line) => d(line, true)).join(''),
    });
    shape.append(svg('title', {}, levels ? `${name}: ${levels}` : name));
    return shape;
  }));
  for (const label of labels) label.sizes.push(measured(label));
  for (const label of labels) label.made.firstChild.textContent = label.full;
  for (const label of labels) label.sizes.push(measured(label));
}

const measured = ({ made }) => [made.firstChild.offsetWidth, made.firstChild.offsetHeight];

const centre = (ring) => {
  const lat = ring.map((p) => p[0]), lon = ring.map((p) => p[1]);
  return [0.5 * (Math.min(...lat) + Math.max(...lat)), 0.5 * (Math.min(...lon) + Math.max(...lon))];
};

// Names stand in their zones, the widest zones first, where there is room; the levels only where the zone is as wide.
function layNames() {
  const [width, height] = size();
  const things = labels.map((label) => {
    const [x, y] = pixel(label.at), xs = label.ring.map((p) => pixel(p)[0]), wide = Math.max(...xs) - Math.min(...xs);
    const long = label.sizes[1][0] < 1.1 * wide, [w, h] = label.sizes[long ? 1 : 0];
    return { label, x, y, r: 0, w, h, inside: true, wide, long };
  }).sort((a, b) => b.wide - a.wide);
  const points = [...document.querySelectorAll('.point')].map((made) => made.getBoundingClientRect());
  const box = frame().getBoundingClientRect();
  const taken = points.map((p) => [p.left - box.left, p.top - box.top, p.right - box.left, p.bottom - box.top]);
  layLabels(things, width, height, taken).forEach((spot, i) => {
    const { label, x, y } = things[i];
    label.made.classList.toggle('mute', !spot || things[i].wide < 8);
    if (!spot) return;
    label.made.firstChild.textContent = things[i].long ? label.full : label.name;
    const b = label.made.firstChild.style;
    b.left = `${spot[0] - x}px`;
    b.top = `${spot[1] - y}px`;
    b.bottom = 'auto';
    b.transform = 'none';
  });
}

export function choose(key) {
  for (const shape of layers.zones.children) shape.classList.toggle('chosen', key !== '' && shape.dataset.key === key);
}

// The outline of a zone while it is drawn or dragged: a circle of metres, or corners.
export function sketch(zone) {
  layers.sketch.replaceChildren();
  if (!zone) return;
  if (zone.radius_m) {
    const [cx, cy] = local(zone.center);
    layers.sketch.append(svg('circle', { class: 'zone draft', cx, cy, r: zone.radius_m * metres(zone.center) }));
  } else if (zone.polygon && zone.polygon.length) {
    layers.sketch.append(svg('path', { class: `zone draft${zone.polygon.length < 3 ? ' open' : ''}`, d: d(zone.polygon, zone.polygon.length > 2) }));
  }
  follow();
}

// -- the path ---------------------------------------------------------------------------------------------------------

// `flat`: lat, lon, amsl_m, lat, …; `how`: judged, draft, unsafe or old.
const lines = new Map();
const tracks = new Map(); // by vehicle: casing, path and what is grasped, and how the path is drawn
let flying = [];
export const places = (flat) => Array.from({ length: Math.floor(flat.length / 3) }, (_, i) => [flat[3 * i], flat[3 * i + 1]]);

export function drawPath(vehicle, flat, how) {
  lines.set(vehicle, places(flat));
  const text = d(lines.get(vehicle)), track = tracks.get(vehicle) || newTrack(vehicle);
  for (const part of ['casing', 'path', 'hit']) track[part].setAttribute('d', text);
  track.how = how;
  dress(vehicle, track);
  if (!whole.getAttribute('transform')) follow();
}

// All paths, or those of some vehicles, are of before.
export function agePath(vehicles = [...tracks.keys()]) {
  for (const [vehicle, track] of tracks) {
    if (!vehicles.includes(vehicle)) continue;
    track.how = 'old';
    dress(vehicle, track);
  }
}

function newTrack(vehicle) {
  const id = vehicle ? `path-${vehicle}` : 'path', made = { casing: svg('path', { class: 'casing' }), path: svg('path', { id }), hit: svg('path', { class: 'grasp', id: `${id}-grasp` }), how: '' };
  for (const part of ['casing', 'path', 'hit']) layers[part].append(made[part]);
  tracks.set(vehicle, made);
  return made;
}

const chosen = (vehicle) => many() && known.state.vehicle === vehicle;

function dress(vehicle, track) {
  track.path.setAttribute('class', `track ${toneOf(vehicle)} ${track.how}${chosen(vehicle) ? ' chosen' : ''}`);
  if (chosen(vehicle)) layers.path.append(track.path); // over the others
}

const crowd = () => known.state.vehicles.length > MOST_SHOWN;

// Where the vehicles of the replay are; null for none.
function drawCrafts(shown) {
  flying = (shown ? shown.spots : []).map(({ vehicle, name, at }) => ({ at, made: el('i', { class: `craft ${toneOf(vehicle)}`, 'data-vehicle': vehicle }, many() && (!crowd() || chosen(vehicle)) ? el('b', {}, name) : null) }));
  crafts.classList.toggle('many', crowd());
  crafts.replaceChildren(...flying.map((craft) => craft.made));
  for (const craft of flying) put(craft.made, craft.at);
}

export function clearPath() {
  lines.clear();
  tracks.clear();
  for (const name of ['path', 'casing', 'hit']) layers[name].replaceChildren();
}

export const lineOf = (vehicle) => lines.get(vehicle) || [];

export function drawNoHome(stretches) {
  layers.nohome.replaceChildren(...stretches.map((flat) => svg('path', {
    class: 'nohome', d: d(Array.from({ length: flat.length / 2 }, (_, i) => [flat[2 * i], flat[2 * i + 1]])),
  })));
}

// A spot of the path that the pointer means, here or in the profile; null for none.
export function pointed(place) {
  layers.pointed.firstChild.setAttribute('d', place ? `${d([place])}h0` : '');
}

// A place with words, such as the one that stands in the way, or (tight) one that is near; null takes it away.
export function markPlace(place, words, look = 'broken') {
  marked = place;
  mark.hidden = !place;
  if (!place) return;
  mark.className = `mark ${look}`;
  mark.firstChild.textContent = words;
  put(mark, place);
}

export const zones = () => (known.state ? known.state.zones.features : []);
