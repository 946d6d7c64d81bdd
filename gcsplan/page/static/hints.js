// What one does first, in three lines; and the same again, with the keys, behind the question mark.
import { button, byId, el } from './dom.js';
import { on } from './hub.js';

const LINES = [
  'Choose ground and aircraft, then click start and goal on the map.',
  'Drag any point; draw what must be avoided. The path follows, and the verdict beside it says whether it is proved.',
  'Fly: try it with simulated vehicles, then upload it to yours. What was sent is read back and compared.',
];
const KEYS = [
  ['Arrow keys', 'move the point that has the focus; with Shift by a pixel'], ['Delete', 'removes a via point, or a zone that is chosen'],
  ['Escape', 'breaks off a drag or a drawing'], ['Ctrl-Z, Ctrl-Y', 'undo, redo'], ['Ctrl-S', 'saves the mission file'],
];
const CURES = [
  ['No mission', 'The place that binds is marked, and each button below the verdict is a change with which a mission was planned.'],
  ['Not judged, or no way home', 'The notes below the figures say what is missing, and the limits say what each key means.'],
  ['An upload is refused', 'The dialogue says why, and what to set or to move; Look again reads the vehicle anew.'],
  ['The connection is lost', 'Edits are kept beside the mission. Start gcsplan map again with the same mission: the page goes on, or open the address that it prints.'],
];
let closed = false;

export function startHints() {
  const card = el('div', { id: 'first', hidden: true }, lines(), button('✕', () => { closed = true; card.hidden = true; }, { class: 'close', 'aria-label': 'Close this hint' }));
  byId('place').append(card);
  const help = el('dialog', { id: 'help', 'aria-labelledby': 'help-title' }, el('h2', { id: 'help-title' }, 'How to plan'), lines(),
    el('h3', {}, 'Where it goes on'), pairs(CURES), el('h3', {}, 'Keys'), pairs(KEYS), el('p', { class: 'buttons' }, button('Close', () => help.close(), { id: 'help-close' })));
  document.body.append(help);
  byId('bar').append(button('?', () => help.showModal(), { id: 'help-open', 'aria-label': 'Help', title: 'How to plan' }));
  on('state', (state) => { card.hidden = closed || state.stage !== 'empty'; });
}

const lines = () => el('ol', {}, ...LINES.map((words) => el('li', {}, words)));
const pairs = (all) => el('dl', {}, ...all.flatMap(([name, words]) => [el('dt', {}, name), el('dd', {}, words)]));
