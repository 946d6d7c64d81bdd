// Points on the map that are dragged by a pointer and moved by arrow keys: start, goal, vias, corners of zones.
import { button } from './dom.js';
import { on } from './hub.js';
import { canvas, frame, moved, pixel, placeAt } from './map.js';

const STEP_PX = 8, FINE_PX = 1;
const REST_MS = 600; // after this long without an arrow key the place counts as dropped

let held = null, layer = null;
const grips = new Set();

export function startGrips() {
  layer = document.createElement('div');
  layer.className = 'grips';
  frame().append(layer);
  on('moved', () => { for (const grip of grips) put(grip); });
}

export const holding = () => held !== null;

// `given`: id, kind and tone (its classes), label (its name), words (beside it), at, live(at), drop(at), cancel(), chosen(), remove() or null; without live it stands still.
export function addGrip(given) {
  const made = button('', () => {}, { class: `point ${given.kind} ${given.tone || ''}`, id: given.id, 'aria-label': given.label, title: given.label });
  if (given.words) {
    const words = document.createElement('b');
    words.textContent = given.words;
    made.append(words);
  }
  const grip = { ...given, made, timer: 0 };
  grips.add(grip);
  layer.append(made);
  put(grip);
  for (const kind of ['mousedown', 'touchstart', 'dblclick']) made.addEventListener(kind, (event) => event.stopPropagation());
  made.addEventListener('pointerdown', (event) => grab(grip, event));
  made.addEventListener('keydown', (event) => key(grip, event));
  made.addEventListener('blur', () => settle(grip));
  made.addEventListener('focus', () => { if (grip.chosen) grip.chosen(); });
  return grip;
}

export function removeGrip(grip) {
  clearTimeout(grip.timer);
  if (held === grip) held = null;
  grips.delete(grip);
  grip.made.remove();
}

export function moveGrip(grip, at) {
  grip.at = at;
  put(grip);
}

function put(grip) {
  const [x, y] = pixel(grip.at);
  grip.made.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
}

// From a press to the release; the point keeps its distance from the pointer.
export function grab(grip, event) {
  if (event.button !== 0 || !grip.live) return;
  event.preventDefault();
  event.stopPropagation();
  const { made } = grip, [x, y] = pixel(grip.at), box = canvas().getBoundingClientRect();
  const off = [x + box.left - event.clientX, y + box.top - event.clientY], from = [event.clientX, event.clientY];
  made.focus({ preventScroll: true });
  made.setPointerCapture(event.pointerId);
  let going = false;
  const move = (e) => {
    if (!going && Math.hypot(e.clientX - from[0], e.clientY - from[1]) < 3) return;
    going = true;
    held = grip;
    moveGrip(grip, placeAt({ clientX: e.clientX + off[0], clientY: e.clientY + off[1] }));
    grip.live(grip.at);
  };
  const end = (e) => {
    for (const [kind, call] of heard) made.removeEventListener(kind, call);
    document.removeEventListener('keydown', escape, true);
    if (held === grip) held = null;
    if (!going) return;
    if (e.type === 'pointerup') grip.drop(grip.at); else grip.cancel();
  };
  const escape = (e) => {
    if (e.key !== 'Escape') return;
    e.stopPropagation();
    end({ type: 'escape' });
  };
  const heard = [['pointermove', move], ['pointerup', end], ['pointercancel', end]];
  for (const [kind, call] of heard) made.addEventListener(kind, call);
  document.addEventListener('keydown', escape, true);
}

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

function key(grip, event) {
  const way = ARROWS[event.key];
  if (way && grip.live && !event.ctrlKey && !event.altKey && !event.metaKey) {
    const step = event.shiftKey ? FINE_PX : STEP_PX;
    held = grip;
    moveGrip(grip, moved(grip.at, step * way[0], step * way[1]));
    grip.live(grip.at);
    clearTimeout(grip.timer);
    grip.timer = setTimeout(() => settle(grip), REST_MS);
  } else if (event.key === 'Enter' && grip.timer) settle(grip);
  else if (event.key === 'Escape' && grip.timer) {
    clearTimeout(grip.timer);
    grip.timer = 0;
    held = null;
    grip.cancel();
  } else if ((event.key === 'Delete' || event.key === 'Backspace') && grip.remove) grip.remove();
  else return;
  event.preventDefault();
  event.stopPropagation();
}

function settle(grip) {
  if (!grip.timer) return;
  clearTimeout(grip.timer);
  grip.timer = 0;
  if (held === grip) held = null;
  grip.drop(grip.at);
}
