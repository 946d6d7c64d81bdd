// A dropped file on the map and in the profile: its line, its items, its zones; the places of what is wrong with it.
import { button, byId, svg } from './dom.js';
import { on, tell } from './hub.js';
import { frame, goTo, local, pixel, transformation } from './map.js';
import { markPlace } from './shapes.js';

const d = (places, closed = false) => (places.length ? `M${places.map((p) => local(p).map((v) => v.toFixed(2)).join(' ')).join('L')}${closed ? 'Z' : ''}` : '');
let whole = null, marks = [], flight = null;

function layer() {
  if (whole) return whole;
  whole = svg('g', {});
  frame().append(svg('svg', { class: 'shapes', id: 'file-shapes', 'aria-hidden': 'true' }, whole));
  on('moved', follow);
  on('plan', () => { if (flight) tell('file profile', flight); }); // the file's profile stays while it is open
  return whole;
}

function follow() {
  whole.setAttribute('transform', transformation());
  for (const { made, at } of marks) {
    const [x, y] = pixel(at);
    made.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
  }
}

export function clearFile() {
  for (const { made } of marks) made.remove();
  marks = [];
  flight = null;
  if (whole) whole.replaceChildren();
  markPlace(null);
}

// The flight of a mission that was dropped; a finding is a button on the map and in the profile.
export function drawFlight(file, go) {
  clearFile();
  const places = Array.from({ length: Math.floor(file.line.length / 3) }, (_, i) => [file.line[3 * i], file.line[3 * i + 1]]);
  layer().append(svg('path', { class: 'casing', d: d(places) }), svg('path', { class: 'track t3 file', d: d(places) }),
    svg('path', { class: 'items', d: file.items.map((item) => `${d([item.at])}h0`).join('') }));
  const byItem = new Map(file.findings.filter((f) => f.at).map((f) => [f.item, f]));
  for (const finding of byItem.values()) {
    const words = `Finding at item ${finding.item}`;
    const made = button(String(finding.item), () => go(finding), { class: 'finding', 'aria-label': words, title: finding.text });
    for (const kind of ['mousedown', 'touchstart', 'dblclick', 'click']) made.addEventListener(kind, (event) => event.stopPropagation());
    frame().append(made);
    marks.push({ made, at: finding.at });
  }
  follow();
  if (!file.profile) return;
  const along = [...byItem.values()].filter((f) => f.distance_m !== null).map((f) => ({ at_m: f.distance_m, item: f.item, words: f.text, go: () => go(f) }));
  flight = { vehicles: [{ vehicle: -1, name: file.name, profile: file.profile, marks: along }] };
  tell('file profile', flight);
}

export function drawFileZones(features) {
  clearFile();
  const rings = ({ type, coordinates }) => (type === 'Polygon' ? [coordinates] : coordinates).flat().map((ring) => ring.map(([lon, lat]) => [lat, lon]));
  layer().append(...features.map((f) => svg('path', { class: 'zone draft', d: rings(f.geometry).map((r) => d(r, true)).join('') })));
  follow();
}

export function drawBounds([west, south, east, north]) {
  clearFile();
  layer().append(svg('path', { class: 'bounds', d: d([[south, west], [south, east], [north, east], [north, west]], true) }));
  follow();
  goTo([0.5 * (south + north), 0.5 * (west + east)]);
}

// The zone, place or finding that the user means: the map goes there.
export function showPlace(at, words) {
  goTo(at);
  markPlace(at, words);
  byId('place').scrollIntoView({ block: 'nearest' }); // on a phone the map is above
}

export const zonePlace = (feature) => {
  const [[lon, lat]] = feature.geometry.type === 'Polygon' ? feature.geometry.coordinates[0] : feature.geometry.coordinates[0][0];
  return [lat, lon];
};
