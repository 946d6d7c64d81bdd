// What a click on the map does: nothing, or one of start, goal, via, circle, polygon. One mode at a time; Escape ends it.
import { button, byId, el, refill } from './dom.js';
import { on, tell } from './hub.js';
import { canvas, frame, middle, panning, placeAt } from './map.js';

const modes = new Map();
let current = null;

// `mode`: name, hint, click(place), and, if it has them, press(event, place), buttons() and leave().
export function addMode(mode) {
  modes.set(mode.name, mode);
}

export const modeNow = () => (current ? current.name : '');

export function enter(name, ...about) {
  leave();
  current = modes.get(name);
  if (current.enter) current.enter(...about);
  panning(!current.press);
  document.body.classList.add('placing');
  show();
}

export function leave() {
  if (!current) return;
  const was = current;
  current = null;
  if (was.leave) was.leave();
  panning(true);
  document.body.classList.remove('placing');
  show();
}

export function show() {
  const hint = byId('hint');
  hint.hidden = !current;
  cross();
  for (const each of document.querySelectorAll('#draw [data-mode]')) {
    each.setAttribute('aria-pressed', String(each.dataset.mode === modeNow()));
  }
  if (!current) return;
  const words = typeof current.hint === 'function' ? current.hint() : current.hint;
  refill(hint, el('span', {}, words), ...(current.buttons ? current.buttons() : []), button('Stop', leave, { id: 'stop', title: 'Escape' }));
}

// A cross shows where Enter puts a point. (Anew with each focus, unlike the hint: its buttons must outlive a press on them.)
function cross() {
  byId('cross').hidden = !current || document.activeElement !== canvas();
}

export function startModes() {
  const box = frame();
  let pressed = null;
  box.addEventListener('pointerdown', (event) => {
    pressed = [event.clientX, event.clientY];
    if (!current || !current.press || event.button !== 0) return;
    event.preventDefault();
    current.press(event, placeAt(event));
  });
  box.addEventListener('click', (event) => {
    if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4) return;
    if (event.target.closest('.point')) return;
    if (current) { if (current.click) current.click(placeAt(event)); return; }
    tell('picked', event);
  });
  box.addEventListener('dblclick', (event) => { if (current && current.finish) { event.preventDefault(); current.finish(); } });
  canvas().addEventListener('keydown', (event) => {
    if (event.key !== 'Enter' || !current || !current.click) return;
    event.preventDefault();
    current.click(middle(), true);
  });
  for (const when of ['focus', 'blur']) canvas().addEventListener(when, cross);
  document.addEventListener('keydown', (event) => { if (event.key === 'Escape' && current) leave(); });
  byId('draw').addEventListener('click', (event) => {
    const wanted = event.target.closest('[data-mode]');
    if (!wanted) return;
    if (wanted.dataset.mode === modeNow()) leave(); else enter(wanted.dataset.mode);
    canvas().focus({ preventScroll: true });
  });
  on('state', (state) => { for (const id of ['draw', 'views', 'legend']) byId(id).hidden = state.stage !== 'mission'; });
}
