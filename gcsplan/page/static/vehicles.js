// Vehicles as they are heard, and missions on board, over the map.
import { el, svg } from './dom.js';
import { on } from './hub.js';
import { frame, pixel } from './map.js';
import { places } from './shapes.js';

let lines = null, marks = null, heard = [], boards = [];

export function startVehicles() {
  lines = svg('svg', { class: 'shapes', 'aria-hidden': 'true' });
  marks = el('div', { class: 'marks', 'aria-hidden': 'true' });
  frame().append(lines, marks);
  on('moved', put);
  on('state', put);
}

export function drawVehicles(vehicles) {
  heard = vehicles.filter((v) => v.at).map((v) => ({ at: v.at, made: el('div', { class: `mark live${v.silent ? ' silent' : ''}` }, el('b', {}, v.name)) }));
  marks.replaceChildren(...heard.map((v) => v.made));
  put();
}

// `vehicles` have `line`: lat, lon, amsl_m, lat, …
export function drawOnBoard(vehicles) {
  boards = vehicles.map((v) => ({ line: places(v.line), made: svg('path', { class: 'on-board' }) })).filter((b) => b.line.length);
  lines.replaceChildren(...boards.map((b) => b.made));
  put();
}

function put() {
  for (const { at, made } of heard) {
    const [x, y] = pixel(at);
    made.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
  }
  for (const { line, made } of boards) made.setAttribute('d', `M${line.map((at) => pixel(at).map((v) => v.toFixed(1)).join(' ')).join('L')}`);
}
