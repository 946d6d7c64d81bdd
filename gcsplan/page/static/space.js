// The report's view in space beside the map: it follows every path while one is dragged, and is whole after each plan.
import { byId, el } from './dom.js';
import { on } from './hub.js';
import { isReady, need, plane } from './scenery.js';
import { pointed } from './shapes.js';

let open = false, scene = null, tried = false, scheduled = false;

export function startSpace() {
  byId('show-space').addEventListener('click', () => set(!open));
  on('scenery', refresh);
  on('scenery-lines', () => {
    if (!scene || scheduled) return;
    scheduled = true;
    requestAnimationFrame(() => { scheduled = false; if (open) scene.takeLines(); });
  });
  on('pointed', (place) => { if (scene && open) point(place); });
}

function set(yes) {
  open = yes;
  byId('show-space').setAttribute('aria-pressed', String(yes));
  byId('beside').hidden = !yes;
  document.body.classList.toggle('with-space', yes);
  if (yes && !byId('scene')) fill();
  need('space', yes);
  if (yes && isReady()) refresh();
}

function fill() {
  const tool = (what, words, label) => el('button', { type: 'button', 'data-do': what, 'aria-label': label, title: label }, words);
  byId('beside').replaceChildren(
    el('figure', { class: 'view scene', id: 'scene' },
      el('canvas', { role: 'img', tabindex: 0, 'aria-label': 'The mission in space: ground, no-fly zones and paths; arrow keys turn it, plus and minus zoom. Map and profile show the same' }),
      el('canvas', { class: 'over', 'aria-hidden': 'true' }), el('p', { class: 'nothing' }, 'The view in space comes with the next plan.')),
    el('div', { class: 'tools', 'data-for': 'scene', hidden: true }, tool('in', '+', 'Zoom in in space'), tool('out', '−', 'Zoom out in space'), tool('home', '⌂', 'The whole view in space')),
    el('label', { class: 'stretch', hidden: true }, 'heights × ', el('input', { type: 'range', min: 1, max: 8, step: 0.5 }), el('output')));
}

function refresh() {
  if (!open) return;
  if (scene) { scene.takeAll(); return; }
  if (tried) return;
  tried = true;
  scene = startScene(() => data.picture);
  watchers.push((k, i) => pointed(k < 0 ? null : ground.degrees(data.lines[k].e[i], data.lines[k].n[i])));
}

// The spot in space of a place that is pointed at in the profile or on the map.
function point(place) {
  if (!place) { nowhere(); return; }
  const near = nearestTrack(data.lines, ...plane(...place));
  if (near) pointAt(near.k, near.i); else nowhere();
}
