// The bar on top: title, undo and redo, units, save; and banners for what the user has to know or decide.
import { button, byId, el } from './dom.js';
import { known, on } from './hub.js';
import { connect, send, step } from './link.js';

const banners = new Map();
let saving = null;

export function startBar() {
  byId('undo').addEventListener('click', () => step({ type: 'undo' }));
  byId('redo').addEventListener('click', () => step({ type: 'redo' }));
  byId('save').addEventListener('click', save);
  byId('units').addEventListener('change', (event) => send({ type: 'units', units: event.target.value }));
  document.addEventListener('keydown', shortcut);
  on('state', state);
  on('saved', (message) => { saving = null; banner('saved', `Saved as ${message.file}.`, [], 'good', 4000); });
  on('error', error);
  on('connection', (now) => {
    if (now === 'open') { banner('connection', ''); banner('taken', ''); }
    if (now === 'lost') banner('connection', 'The connection with gcsplan is lost; the page tries again every second. Edits until now are kept. If gcsplan has ended, start it again with the same mission: this page goes on.', [], 'bad');
    if (now === 'other') banner('connection', 'Another program, or a gcsplan with a new address, answers where gcsplan was. Start gcsplan map again, and open the address that it prints.', [], 'bad');
    if (now === 'taken') banner('taken', 'The mission is open in another tab, which counts now.', [button('Use this tab', connect)], 'bad');
  });
  on('unsent', () => banner('unsent', 'There is no connection: this change was not made.', [], 'bad', 4000));
}

function shortcut(event) {
  if (!(event.ctrlKey || event.metaKey) || event.altKey || event.target.closest('dialog')) return;
  const key = event.key.toLowerCase();
  if (key !== 's' && event.target.closest('input, textarea')) return; // a field undoes its own typing
  const target = { z: event.shiftKey ? 'redo' : 'undo', y: 'redo', s: 'save' }[key];
  if (!target) return;
  event.preventDefault();
  if (!byId(target).disabled) byId(target).click();
}

function state(now) {
  byId('title').textContent = now.stage === 'empty' ? 'gcsplan map' : now.name || 'New mission';
  document.title = now.stage === 'empty' ? 'gcsplan map' : `${now.saved ? '' : '• '}${now.name || 'New mission'} – gcsplan map`;
  byId('undo').disabled = !now.undo;
  byId('redo').disabled = !now.redo;
  const button_ = byId('save');
  button_.disabled = now.stage !== 'mission' || (now.saved && now.disk !== 'changed');
  button_.textContent = now.saved && now.file ? 'Saved' : 'Save';
  const units = byId('units');
  if (units.options.length !== now.units.systems.length) units.replaceChildren(...now.units.systems.map((s) => el('option', { value: s }, s)));
  units.value = now.units.name;
  const name = now.file || '';
  if (now.disk === 'changed') {
    banner('disk', `${name} was changed on disk by another program.`, [button('Take the file', () => step({ type: 'reload' })), button('Keep mine: save over it', () => send({ type: 'save', over: true }))], 'warn');
  } else if (now.disk === 'gone') banner('disk', `${name} is no longer on disk; Save writes it again.`, [], 'warn');
  else banner('disk', '');
  banner('restored', now.restored && !now.saved ? 'Edits of an earlier run that were not saved are in force. Undo takes them back.' : '', [], 'warn');
}

function error(message) {
  if (message.code === 'exists' || message.code === 'changed_on_disk') { decide(message); return; }
  if (['bad_mission', 'bad_text', 'file_exists'].includes(message.code) || message.where === 'place') return; // beside their fields
  if (message.code === 'taken_over') return;
  banner('error', message.where ? `${message.where}: ${message.message}` : message.message, [], 'bad', 12000);
}

// A banner by name; empty words take it away. It goes by itself after some time if it reports only what has happened: it
// then lies over the page, so that nothing moves away under the pointer.
export function banner(name, words, buttons = [], look = 'warn', after = 0) {
  const old = banners.get(name);
  if (old && words && old.words === words && !after) return;
  if (old) { clearTimeout(old.timer); old.made.remove(); banners.delete(name); }
  if (!words) return;
  const close = button('✕', () => banner(name, ''), { class: 'close', 'aria-label': 'Close this message' });
  const made = el('div', { class: `banner ${look}${after ? ' passing' : ''}`, role: look === 'bad' ? 'alert' : null }, el('span', {}, words), ...buttons, close);
  byId('banners').append(made);
  banners.set(name, { made, words, timer: after ? setTimeout(() => banner(name, ''), after) : 0 });
}

// -- saving -----------------------------------------------------------------------------------------------------------

function save() {
  if (known.state.file) { saving = {}; send({ type: 'save' }); return; }
  ask('Save the mission', 'A name in the folder in which gcsplan was started.', 'mission.yaml', (name) => { saving = { name }; send({ type: 'save', name }); });
}

function decide(message) {
  const over = button('Save over it', () => { dialog().close(); send({ type: 'save', over: true, ...saving }); }, { class: 'main' });
  const other = message.code === 'changed_on_disk' ? button('Take the file', () => { dialog().close(); step({ type: 'reload' }); })
    : button('Another name', () => { dialog().close(); ask('Save the mission', 'A name in the folder in which gcsplan was started.', saving?.name || 'mission.yaml', (name) => { saving = { name }; send({ type: 'save', name }); }); });
  open('Nothing is saved yet', message.message, null, [over, other]);
}

const dialog = () => byId('ask');

function ask(title, words, value, then) {
  const input = el('input', { id: 'ask-name', type: 'text', value, 'aria-label': 'File name', autocomplete: 'off', spellcheck: 'false' });
  const done = () => { const name = input.value.trim(); if (!name) return; dialog().close(); then(name); };
  input.addEventListener('keydown', (event) => { if (event.key === 'Enter') { event.preventDefault(); done(); } });
  open(title, words, input, [button('Save', done, { class: 'main' })]);
  input.select();
}

function open(title, words, field, buttons) {
  dialog().replaceChildren(el('h2', { id: 'ask-title' }, title), el('p', {}, words), ...(field ? [field] : []), el('p', { class: 'buttons' }, ...buttons, button('Cancel', () => dialog().close())));
  if (!dialog().open) dialog().showModal();
}
