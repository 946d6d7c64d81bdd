// The report's own drawing: its scripts are loaded when they are first needed, and get the numbers of each plan. While a path
// follows the pointer it stands there in grey, as it is not judged.
import { el } from './dom.js';
import { known, on, tell } from './hub.js';
import { send } from './link.js';

const SCRIPTS = ['base', 'view', 'flight', 'replay', 'mesh', 'scene'];
const PIECES = 60; // of a path that is not judged, so that its shadow follows the ground
const users = new Set();
let asked = false, loading = null, ready = false;

export const isReady = () => ready;

// Who needs the scenery: it is requested while anybody does.
export function need(who, yes) {
  if (yes) users.add(who); else users.delete(who);
  if (asked !== users.size > 0) ask();
}

function ask() {
  asked = users.size > 0;
  send({ type: 'scene', on: asked });
}

export function startScenery() {
  on('connection', () => { asked = false; });
  on('state', () => { if (users.size && !asked) ask(); });
  on('scene', async (message) => {
    const { type, n, ...fresh } = message;
    fresh.units = known.state.units.kinds;
    if (!loading) {
      globalThis.data = { ...fresh, charts: {} };
      loading = load();
    }
    await loading;
    if (n < known.n) return; // another plan has begun
    takeNumbers(fresh);
    replay.tracks = tracksNow();
    ready = true;
    tell('scenery', message);
  });
  on('path', (message) => {
    if (!ready) return;
    const name = known.state.vehicles[message.vehicle].name, old = data.lines.findIndex((line) => line.index === message.vehicle);
    data.lines = [...data.lines.filter((_, k) => k !== old), draft(message.vehicle, name, message.line)];
    tell('scenery-lines');
  });
}

function load() {
  return SCRIPTS.reduce((before, name) => before.then(() => new Promise((done, fail) => {
    document.head.append(el('script', { src: `report/${name}.js`, onload: done, onerror: fail }));
  })), Promise.resolve());
}

// East and north of a place: the lattice of the ground is all but even, and the one step mends what it is not.
export function plane(lat, lon) {
  const middle = [0.5 * (ground.west + ground.east), 0.5 * (ground.south + ground.north)], step = 0.25 * Math.min(ground.width, ground.height);
  const [a, b] = ground.degrees(...middle), [a1, b1] = ground.degrees(middle[0] + step, middle[1]), [a2, b2] = ground.degrees(middle[0], middle[1] + step);
  const m = [(a1 - a) / step, (a2 - a) / step, (b1 - b) / step, (b2 - b) / step], det = m[0] * m[3] - m[1] * m[2];
  const moved = ([e, n], u, v) => [e + (m[3] * u - m[1] * v) / det, n + (m[0] * v - m[2] * u) / det];
  const first = moved(middle, lat - a, lon - b), [u, v] = ground.degrees(...first);
  return Number.isNaN(u) ? first : moved(first, lat - u, lon - v);
}

function draft(index, name, flat) {
  const line = { index, name, draft: true, s: [], e: [], n: [], z: [], g: [], o: null, f: [], c: [], t: [], j: null, leg: [], ends: [], broken: [], legs: [{ seq: '–', kind: 'not judged', column: false, climb: null }] };
  let before = null;
  for (let i = 0; i + 2 < flat.length; i += 3) {
    const here = [...plane(flat[i], flat[i + 1]), flat[i + 2]];
    for (let k = before ? 1 : PIECES; k <= PIECES; k++) {
      const [e, n, z] = before ? here.map((v, j) => before[j] + (k / PIECES) * (v - before[j])) : here, g = ground.at(e, n), last = line.s.length - 1;
      line.s.push(last < 0 ? 0 : line.s[last] + Math.hypot(e - line.e[last], n - line.n[last]));
      line.e.push(e); line.n.push(n); line.z.push(z); line.g.push(Number.isNaN(g) ? null : g);
      line.f.push(null); line.c.push(null); line.t.push(null); line.leg.push(0);
    }
    before = here;
  }
  line.ends = [line.s.length - 1];
  return line;
}
