// The dialogue of an upload: a look at the vehicles, the decision, the progress, what was read back.
import { button, byId, el, refill } from './dom.js';
import { MOST_SHOWN } from './fleet.js';
import { known, on } from './hub.js';
import { send } from './link.js';
import { drawOnBoard } from './vehicles.js';

const PERMISSIONS = [
  ['allow_armed', 'An armed vehicle may get it'], ['ignore_position', 'The vehicle may stand elsewhere'],
  ['allow_parameters', 'Judge it with parameters on board that are off the list'], ['allow_unjudged', 'Send what could not be judged'],
  ['atomic', 'All or nothing: if one upload fails, the others are cleared'], ['fence', 'Send the zones as a fence first'], ['rally', 'Send rally points that the way home proposes'],
];
let dialog = null, to = '', given = {}, sending = 0, looking = 0, parts = new Map();

export function startUpload() {
  dialog = el('dialog', { id: 'upload', 'aria-labelledby': 'upload-title' });
  document.body.append(dialog);
  dialog.addEventListener('cancel', (event) => { if (sending) event.preventDefault(); });
  dialog.addEventListener('close', () => drawOnBoard([]));
  on('looked', looked);
  on('progress', progress);
  on('uploaded', (message) => { sending = 0; ended(message); });
  on('steps', (message) => { if (sending && !message.busy) { sending = 0; if (message.last) ended(message.last); else dialog.close(); } });
  on('error', (message) => { if (dialog.open && (message.code === 'not_sent' || message.code === 'internal')) { sending = 0; show('Nothing was sent', [el('p', { class: 'bad', role: 'alert' }, message.message), permissions()], [again()]); } });
  on('connection', (now) => {
    if (now === 'open' || !dialog.open) return;
    show(sending ? 'The connection with gcsplan is lost' : 'Not connected', [el('p', { class: 'bad', role: 'alert' }, sending
      ? 'The upload is broken off, and the vehicle is informed; what it holds now is not known: look at it again.' : 'The page tries to connect again.')], []);
  });
  addEventListener('beforeunload', (event) => { if (sending) event.preventDefault(); });
}

export function upload(where) {
  to = where;
  given = {};
  look();
}

function look() {
  looking = send({ type: 'look', to, plan: known.plan.plan, ...given });
  if (!looking) return;
  show('Looking at the vehicles', [el('p', { role: 'status' }, `Their state, parameters and missions are read from ${to}. Nothing is written to them.`)], [], 'Cancel');
}

const again = () => button('Look again', look, { id: 'upload-again' });

function show(title, body, buttons, close = 'Close') {
  const leave = button(close, () => { if (close === 'Cancel') send({ type: 'stop' }); dialog.close(); }, { id: 'upload-close' });
  refill(dialog, el('h2', { id: 'upload-title' }, title), ...body, el('p', { class: 'buttons' }, ...buttons, leave));
  if (!dialog.open) dialog.showModal();
  dialog.scrollTop = 0;
}

// -- the look ---------------------------------------------------------------------------------------------------------

function looked(message) {
  if (!dialog.open || message.n !== looking) return;
  if (message.code) {
    show('Nothing can be sent', [el('p', { class: 'bad', role: 'alert' }, message.message), permissions()], [again()]);
    return;
  }
  drawOnBoard(message.vehicles.filter((v) => v.on_board).map((v) => v.on_board));
  const ok = message.vehicles.filter((v) => v.found && !v.against), one = message.vehicles.length === 1;
  const words = one ? `Send to ${message.vehicles[0].name}` : ok.length === message.vehicles.length ? `Send to ${ok.length} vehicles` : `Send to ${ok.length} of ${message.vehicles.length} vehicles`;
  const go = button(words, () => start(message), { id: 'upload-send', class: 'main', disabled: !message.ticket });
  show(one ? `Upload to ${message.vehicles[0].name}` : `Upload to ${message.vehicles.length} vehicles`,
    [...each(message.vehicles, vehicle, (v) => Boolean(v.against) || !v.safe), release(message.release), ...notes(message.notes), el('p', { class: 'note' }, `The files go to ${message.folder}.`), permissions()], [go, again()], 'Not now');
}

// Of many vehicles each is folded to a line; those with something against them come first, and are open.
function each(all, made, wrong) {
  if (all.length <= MOST_SHOWN) return all.map(made);
  return [...all].sort((a, b) => wrong(b) - wrong(a)).map((v) => {
    const part = made(v), head = part.firstChild, off = (v.parameters || []).filter((p) => p.off).length;
    head.remove();
    return el('details', { class: 'vehicle', open: wrong(v) }, el('summary', {}, ...head.childNodes, off ? el('span', { class: 'warn' }, `, ${off === 1 ? '1 parameter' : `${off} parameters`} to set`) : null), ...part.childNodes);
  });
}

function vehicle(v) {
  const off = v.parameters.filter((p) => p.off), board = v.on_board;
  return el('section', { class: 'vehicle' },
    el('h3', {}, v.name, el('span', { class: 'note' }, ` at ${v.url}${v.what ? `: ${v.what}` : ''}, ${v.items} items`)),
    el('p', { class: v.safe ? 'good' : 'bad' }, v.verdict),
    v.against ? el('p', { class: 'bad', role: 'alert' }, v.against) : null,
    v.wind ? el('p', { class: v.beyond ? 'warn' : 'note' }, v.wind) : null,
    board ? el('details', {}, el('summary', {}, `On board: ${board.headline}`), table(['', 'on board', 'plan', ''], board.rows), ...notes(board.remarks)) : null,
    v.parameters.length ? el('details', { open: off.length > 0 && off.length < 4 },
      el('summary', { class: off.length ? 'warn' : '' }, off.length ? `${off.length} of ${v.parameters.length} parameters to set on board` : `${v.parameters.length} parameters are as the proof assumes, or not known`),
      table(['', 'assumed', 'on board', ''], v.parameters.map((p) => [p.name, `${p.rule === 'equal' ? '' : `${p.rule} `}${p.value}`, p.on_board || '–', p.why]), v.parameters.map((p) => Boolean(p.off)))) : null,
    ...notes(v.notes));
}

const notes = (all) => (all.length ? [el('ul', { class: 'notes' }, ...all.map((words) => el('li', {}, words)))] : []);

function table(heads, rows, bad = []) {
  return el('div', { class: 'wide-table' }, el('table', {}, el('thead', {}, el('tr', {}, ...heads.map((h) => el('th', { scope: 'col' }, h)))),
    el('tbody', {}, ...rows.map((row, i) => el('tr', { class: bad[i] ? 'bad' : '' }, ...row.map((cell, k) => el(k ? 'td' : 'th', k ? {} : { scope: 'row' }, cell)))))));
}

// When each vehicle is started by hand; null for one vehicle, and where a step did not come so far.
function release(found) {
  if (!found) return null;
  const windy = found.rows.some((r) => r.window_s), late = found.rows.map((r) => r.ready === false);
  return el('section', { id: 'upload-release' }, el('h3', {}, 'Release'), el('p', { class: 'note' }, 'By hand: nothing is armed or started from here.'),
    table(['', 'release, T+', 'at the goal, T+', ...(windy ? ['within'] : []), ''], found.rows.map((r) => [r.name, duration(r.release_s, 1), duration(r.arrive_s, 1), ...(windy ? [r.window_s ? r.window_s.map((s) => duration(s, 1)).join(' to ') : ''] : []), r.ready === false ? 'not ready' : '']), late),
    el('p', { class: 'note' }, found.start_utc ? `T+0 is ${found.start_utc} UTC: each vehicle waits in the air for its own second.` : 'T+0 is the moment that you choose.'));
}

function permissions() {
  return el('details', { open: Object.values(given).some(Boolean), id: 'upload-permissions' }, el('summary', {}, 'Permissions, fence and rally points'),
    ...PERMISSIONS.map(([key, words]) => el('label', { class: 'choice' }, el('input', {
      type: 'checkbox', id: `upload-${key}`, checked: given[key] || false, onchange: (event) => { given = { ...given, [key]: event.target.checked }; look(); },
    }), words)),
    known.state.vehicles.length > 1 ? el('div', { class: 'row' }, el('label', { for: 'upload-gate' }, 'T+0 by the clock, UTC'), el('input', {
      id: 'upload-gate', type: 'text', placeholder: '18:30:00', autocomplete: 'off', value: given.gate_utc || '', onchange: (event) => { given = { ...given, gate_utc: event.target.value.trim() }; look(); },
    }), el('p', { class: 'note' }, 'Each ArduCopter then waits in the air for its second of the day. Nobody knows how long, so it needs “Send what could not be judged”.')) : null);
}

// -- sending ----------------------------------------------------------------------------------------------------------

function start(message) {
  sending = send({ type: 'upload', ticket: message.ticket, plan: message.plan });
  if (!sending) return;
  parts = new Map(message.vehicles.map((v) => [v.name, { bar: el('progress', { max: 1, value: 0, 'aria-label': v.name }), words: el('span', {}, 'checked again …') }]));
  show('Sending', [...parts].map(([name, part]) => el('p', { class: 'sending' }, el('strong', {}, name), part.bar, part.words)), [], 'Cancel');
  const stop = byId('upload-close');
  stop.textContent = 'Stop';
  stop.replaceWith(button('Stop', () => send({ type: 'stop' }), { id: 'upload-stop' }));
}

function progress(message) {
  const part = parts.get(message.name);
  if (!part || !sending) return;
  part.bar.max = Math.max(message.total, 1);
  part.bar.value = message.done;
  part.words.textContent = `${message.phase}${message.total ? `, ${message.done} of ${message.total}` : ''}`;
}

function ended(message) {
  const good = message.code === 0, all = message.vehicles;
  const body = all.length ? each(all, result, (v) => !v.verified) : [el('p', { class: 'bad', role: 'alert' }, message.message)];
  show(good ? (all.length === 1 ? `${all[0].name} is verified` : `${all.length} vehicles are verified`) : 'Not verified',
    [el('p', { class: `verdict ${good ? 'safe' : 'unsafe'}`, role: 'status', id: 'upload-end' }, good ? 'The mission was read back, is equal item for item, and passes the check.' : `Exit code ${message.code}: ${message.reason}`), ...body, release(message.release), ...notes(message.notes)],
    good ? [el('a', { class: 'button', href: 'report.html', target: '_blank' }, 'Briefing')] : [again()]);
}

function result(v) {
  return el('section', { class: 'vehicle' }, el('h3', {}, v.name, el('span', { class: 'note' }, ` at ${v.url}${v.simulated ? ', simulated' : ''}: ${v.items} items, ${v.outcome}, ${v.verified ? 'read back and verified' : 'not verified'}, ${v.seconds.toFixed(1)} s`)),
    v.message ? el('p', { class: 'bad' }, v.message) : null, ...notes(v.notes));
}
