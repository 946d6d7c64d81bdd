// The connection with the server: messages out, answers in, and a new connection where one is lost.
import { known, take, tell } from './hub.js';

const AGAIN_MS = 1000;
const SLOW_MS = 400; // a live plan that takes longer is superseded by the pointer's newest place
const TAKEN_OVER = 4000;

let socket = null, count = 0, waiting = null, asked = 0, askedAt = 0, scheduled = false;

export function connect() {
  const url = new URL('socket', document.baseURI);
  url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
  const made = new WebSocket(url);
  socket = made;
  made.addEventListener('open', () => {
    tell('connection', 'open');
    send({ type: 'hello' });
  });
  made.addEventListener('message', (event) => {
    const message = JSON.parse(event.data);
    if (message.type !== 'state' && message.n >= asked) asked = 0;
    take(message);
    pump();
  });
  made.addEventListener('close', (event) => {
    if (socket !== made) return;
    socket = null;
    asked = 0;
    waiting = null;
    known.busy = false;
    if (event.code === TAKEN_OVER) { tell('connection', 'taken'); return; }
    again('lost');
  });
}

// The token goes to no other program that has taken the port meanwhile: a server first proves that it knows it.
async function again(how) {
  tell('connection', how);
  const token = location.pathname.split('/')[1], text = btoa(String.fromCharCode(...crypto.getRandomValues(new Uint8Array(24)))).replace(/\+/g, '-').replace(/\//g, '_');
  const bytes = (words) => new TextEncoder().encode(words);
  let now = 'lost';
  try {
    const key = await crypto.subtle.importKey('raw', bytes(token), { name: 'HMAC', hash: 'SHA-256' }, false, ['sign']);
    const proof = [...new Uint8Array(await crypto.subtle.sign('HMAC', key, bytes(`gcsplan map ${text}`)))].map((b) => b.toString(16).padStart(2, '0')).join('');
    const answer = await fetch(`/proof/${text}`, { redirect: 'error', signal: AbortSignal.timeout(4 * AGAIN_MS) });
    if (await answer.text() === proof) { connect(); return; }
    if ([200, 404].includes(answer.status)) now = 'other';
  } catch { /* nobody is there */ }
  setTimeout(() => again(now), AGAIN_MS);
}

const open = () => socket !== null && socket.readyState === WebSocket.OPEN;

// Sends a message; its number, or 0 while there is no connection.
export function send(message) {
  if (!open()) { tell('unsent', message); return 0; }
  count += 1;
  socket.send(JSON.stringify({ ...message, n: count }));
  return count;
}

// Changes keys of the mission as one step of undo.
export function change(changes) {
  return step({ type: 'change', changes });
}

// A message after which the mission is planned anew; what was dragged before it no longer counts.
export function step(message) {
  waiting = null;
  asked = 0;
  known.busy = open();
  const n = send(message);
  known.n = Math.max(known.n, n); // answers to what was before it come too late
  if (n) tell('asked', n);
  return n;
}

// Changes keys while something is dragged: the newest change goes out in the next frame, one at a time.
export function live(changes) {
  waiting = changes;
  tell('dragged', changes);
  pump();
}

function pump() {
  if (!waiting || scheduled) return;
  scheduled = true;
  requestAnimationFrame(() => {
    scheduled = false;
    if (!waiting) return;
    const late = performance.now() - askedAt;
    if (asked && late < SLOW_MS) { setTimeout(pump, SLOW_MS - late); return; }
    asked = send({ type: 'change', changes: waiting, live: true });
    askedAt = performance.now();
    waiting = null;
  });
}
