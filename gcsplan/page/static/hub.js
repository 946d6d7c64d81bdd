// The newest messages of the server, and who listens to them.
const listeners = new Map();

export const known = { state: null, plan: null, n: 0, busy: false, datums: {} };

export function on(kind, call) {
  listeners.set(kind, [...(listeners.get(kind) || []), call]);
}

export function tell(kind, value) {
  for (const call of listeners.get(kind) || []) call(value);
}

const ANSWERS = new Set(['path', 'bound', 'interim', 'plan', 'home', 'refused', 'scene']);

// Takes a message of the server; an answer to what has been changed since is left out.
export function take(message) {
  if (ANSWERS.has(message.type)) {
    if (message.n < known.n) return;
    if (message.type !== 'scene') known.n = message.n; // a scene answers a later message; the way home of its plan may follow
  }
  if (message.type === 'state') known.state = message;
  if (message.type === 'plan') known.plan = message;
  if (message.type === 'plan' || message.type === 'refused' || message.type === 'error') known.busy = false;
  tell(message.type, message);
}

// A number in SI with its unit, in the units that the user reads.
export function worded(value, decimals, kind) {
  return num(value, decimals, known.state.units.kinds[kind]);
}
