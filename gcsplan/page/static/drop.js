// A file that is dropped on the page, or chosen: its bytes go to the server, which says what it is and what is wrong with it.
import { button, byId, el, refill } from './dom.js';
import { known, on, tell } from './hub.js';
import { send, step } from './link.js';
import { banner } from './bar.js';
import { clearFile } from './filemap.js';
import { fileParts } from './filewords.js';

let box = null, file = null, stage = '', looked = 0, settings = {}, stale = false, input = null, taken = null;

export function startDrop() {
  box = el('section', { id: 'file', 'aria-label': 'A file' });
  input = el('input', { id: 'file-input', type: 'file', 'aria-label': 'A file to check or to take', hidden: true, onchange: () => { if (input.files.length) upload(input.files[0]); input.value = ''; } });
  document.body.append(input);
  for (const kind of ['dragenter', 'dragover']) document.addEventListener(kind, over);
  document.addEventListener('dragleave', (event) => { if (!event.relatedTarget) document.body.classList.remove('dropping'); });
  document.addEventListener('drop', dropped);
  on('dropped', (message) => { if (message.n === looked) show(message); });
  on('state', state);
  on('error', refused);
  on('connection', (now) => { if (now === 'open' && file) close(); }); // a new server has no file
  idle();
}

const carriesFile = (event) => [...(event.dataTransfer?.types || [])].includes('Files');

function over(event) {
  if (!carriesFile(event)) return;
  event.preventDefault();
  event.dataTransfer.dropEffect = 'copy';
  document.body.classList.add('dropping');
}

function dropped(event) {
  if (!carriesFile(event)) return;
  event.preventDefault();
  document.body.classList.remove('dropping');
  const { files } = event.dataTransfer;
  if (files.length > 1) { banner('file', 'One file at a time: drop them one after the other.', [], 'warn', 8000); return; }
  if (files.length) upload(files[0]);
}

// -- sending ----------------------------------------------------------------------------------------------------------

async function upload(chosen) {
  const ending = (/\.[^.]*$/.exec(chosen.name.toLowerCase()) || [''])[0], most = known.state?.drops[ending];
  if (most && chosen.size > most) { banner('file', `${chosen.name} has ${chosen.size} bytes, more than ${most}: simplify or split it.`, [], 'bad'); return; }
  close();
  banner('file', '');
  waitFor(chosen.name);
  let answer = null;
  try {
    const sent = most ? chosen : chosen.slice(0, 0); // the server says why it takes no such file
    const response = await fetch(`dropped/${encodeURIComponent(chosen.name.slice(-200))}`, { method: 'PUT', body: sent });
    if (!response.ok) throw new Error(`${chosen.name} was not taken (${response.status}): drop it again.`);
    answer = await response.json();
    if (answer.error) throw new Error(answer.error);
  } catch (error) {
    close();
    banner('file', error instanceof TypeError ? `${chosen.name} cannot be sent: is it a folder, has it changed, or has gcsplan ended?` : error.message, [], 'bad');
    return;
  }
  settings = {};
  look();
}

function look(more = {}) {
  if (more.settings) settings = more.settings;
  looked = send({ type: 'inspect', ...more, settings });
}

// Takes the file into the mission as the page shows it.
function take(more = {}) {
  const whole = { kind: file.kind, ...more };
  if (file.kind === 'ground') known.datums[file.name] = settings.vertical_datum; // for a mission that begins on it
  taken = { n: step({ type: 'take', ...whole, settings }), whole };
}

// -- showing ----------------------------------------------------------------------------------------------------------

function waitFor(name) {
  box.replaceChildren(el('h2', {}, name), el('p', { class: 'note', role: 'status' }, 'The file is read and checked.'));
  byId('panel').prepend(box);
}

function show(message) {
  file = message;
  stale = file.kind === 'mission' && Boolean(file.error) && known.state.stage === 'mission';
  const inside = box.contains(document.activeElement) && document.activeElement.id;
  redraw();
  if (!inside || !byId(inside)) byId('file-title').focus({ preventScroll: true });
  box.scrollIntoView({ block: 'nearest' });
}

function redraw() {
  stage = known.state.stage;
  if (!file) { idle(); return; }
  const { name } = file;
  refill(box,
    el('div', { class: 'heading' }, el('h2', { id: 'file-title', tabindex: -1 }, name), button('✕', close, { class: 'close', 'aria-label': `Close ${name}` })),
    el('p', { class: 'note', id: 'file-stale', role: 'status', hidden: !stale }, file.error ? '' : 'The mission has changed since. ', button('Check again', () => look({ kind: file.kind, vehicle: file.vehicle, as: file.as }), { id: 'file-again' })),
    ...fileParts(file, settings, { look, take }));
  byId('panel').prepend(box);
}

function idle() {
  box.replaceChildren(button('Check or add a file …', () => input.click(), { id: 'file-open', class: 'wide' }),
    el('p', { class: 'note' }, 'Or drop it on the page: .plan, .waypoints, zones of any format, KML, GeoTIFF.'));
}

function close() {
  file = null;
  clearFile();
  tell('file profile', known.plan);
  idle();
  byId('panel').append(box);
}

function state(now) {
  const panel = byId('panel');
  if (!panel.contains(box)) { if (file) panel.prepend(box); else panel.append(box); }
  if (taken && file && now.n >= taken.n) { taken = null; close(); return; }
  if (file && stage !== now.stage) redraw();
  if (file && now.n > looked && !stale) {
    stale = file.kind === 'mission';
    if (stale) byId('file-stale').hidden = false;
  }
}

function refused(message) {
  if (message.n === looked && message.code === 'bad_file') { close(); banner('file', message.message, [], 'bad'); return; }
  if (!taken || message.n !== taken.n) return;
  const again = taken.whole;
  taken = null;
  if (message.code === 'file_exists') banner('file', message.message, [button('Replace it', () => { banner('file', ''); take({ ...again, over: true }); }, { id: 'file-over' })], 'warn');
}
