// A file that is dropped on the page, or chosen: its bytes go to the server, which says what it is and what is wrong with it.
import { button, byId, el, refill } from './dom.js';
import { known, on, tell } from './hub.js';
import { send, step } from './link.js';
import { banner } from './bar.js';
import { clearFile } from './filemap.js';
import { fileParts } from './filewords.js';

const MOST_WAITING = 64;
let waiting = [], uploads = 0, box = null, file = null, stage = '', looked = 0, settings = {}, stale = false, input = null, taken = null;

export function startDrop() {
  box = el('section', { id: 'file', 'aria-label': 'A file' });
  input = el('input', { id: 'file-input', type: 'file', multiple: true, 'aria-label': 'Files to check or to take', hidden: true, onchange: () => { if (input.files.length) dropAll([...input.files]); input.value = ''; } });
  document.body.append(input);
  for (const kind of ['dragenter', 'dragover']) document.addEventListener(kind, over);
  document.addEventListener('dragleave', (event) => { if (!event.relatedTarget) document.body.classList.remove('dropping'); });
  document.addEventListener('drop', dropped);
  on('dropped', (message) => { if (message.n === looked) show(message); });
  on('state', state);
  on('error', refused);
  on('connection', (now) => { if (now === 'open' && file) { waiting = []; close(); } }); // a new server has no file
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
  const { files, items } = event.dataTransfer, folder = [...items].map((item) => item.webkitGetAsEntry?.()).find((entry) => entry?.isDirectory);
  if (folder) banner('file', `${folder.name} is a folder: drop the files that are in it.`, [], 'bad');
  else if (files.length) dropAll([...files]);
}

// -- sending ----------------------------------------------------------------------------------------------------------

const endingOf = (name) => (/(\.aux)?\.[^.]*$/.exec(name.toLowerCase()) || [''])[0];

// Files of ground belong together; all others wait, and come one after the other.
function dropAll(files) {
  const ground = files.filter((f) => known.state?.grounds.includes(endingOf(f.name))), others = files.filter((f) => !ground.includes(f));
  waiting = [...(ground.length ? [ground] : []), ...others.map((f) => [f])].slice(0, MOST_WAITING);
  if (files.length > MOST_WAITING && others.length) banner('file', `${MOST_WAITING} files at a time: drop the others later.`, [], 'warn', 8000);
  next();
}

function next() {
  const files = waiting.shift();
  if (files) upload(files);
}

async function upload(files) {
  const mine = ++uploads;
  close();
  banner('file', '');
  for (const [k, chosen] of files.entries()) {
    const most = known.state?.drops[endingOf(chosen.name)];
    waitFor(files.length > 1 ? `${chosen.name}, ${k + 1} of ${files.length}` : chosen.name);
    try {
      if (most && chosen.size > most) throw new Error(`${chosen.name} has ${chosen.size} bytes, more than ${most}: simplify or split it.`);
      const sent = most ? chosen : chosen.slice(0, 0); // the server says why it takes no such file
      const response = await fetch(`dropped/${encodeURIComponent(chosen.name.slice(-200))}${k ? '?more=yes' : ''}`, { method: 'PUT', body: sent });
      if (!response.ok) throw new Error(`${chosen.name} was not taken (${response.status}): drop it again.`);
      const answer = await response.json();
      if (mine !== uploads) return; // others were dropped meanwhile
      if (answer.error) throw new Error(answer.error);
    } catch (error) {
      if (mine !== uploads) return;
      close();
      banner('file', error instanceof TypeError ? `${chosen.name} cannot be sent: is it a folder, has it changed, or has gcsplan ended?` : error.message, waiting.length ? [button('The next file', next, { id: 'file-next' })] : [], 'bad');
      return;
    }
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
  if (file.kind === 'ground') for (const name of file.files || []) known.datums[name] = settings.vertical_datum; // for a mission that begins on it
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
    el('div', { class: 'heading' }, el('h2', { id: 'file-title', tabindex: -1 }, name), waiting.length ? button(`Next of ${waiting.length}`, next, { id: 'file-next' }) : null, button('✕', () => { close(); next(); }, { class: 'close', 'aria-label': `Close ${name}` })),
    el('p', { class: 'note', id: 'file-stale', role: 'status', hidden: !stale }, file.error ? '' : 'The mission has changed since. ', button('Check again', () => look({ kind: file.kind, vehicle: file.vehicle, as: file.as }), { id: 'file-again' })),
    ...fileParts(file, settings, { look, take }));
  byId('panel').prepend(box);
}

function idle() {
  box.replaceChildren(button('Check or add a file …', () => input.click(), { id: 'file-open', class: 'wide' }),
    el('p', { class: 'note' }, 'Or drop it on the page: .plan, .waypoints, zones of any format, KML, terrain. Several files at once are taken in turn; tiles of terrain together.'));
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
  if (taken && file && now.n >= taken.n) { taken = null; close(); next(); return; }
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
