// Where the vehicles of the replay are at a time: interpolated between the places of the page's data.

// A track of the data with its places as numbers, five in a row: time, east, north, AMSL, height above ground.
function trackOf(one) {
  const bytes = Uint8Array.from(atob(one.places), (c) => c.charCodeAt(0));
  const at = new Float32Array(bytes.buffer), n = at.length / 5;
  return { ...one, at, n, begin: at[0], end: at[5 * (n - 1)] };
}

// Where a vehicle is at `t`, and what it does there; null for one that is gone.
function placeAt(track, t) {
  const { at, n } = track, row = (i) => ({ e: at[5 * i + 1], n: at[5 * i + 2], z: at[5 * i + 3], agl: at[5 * i + 4] });
  if (t < track.begin) return { ...row(0), state: 'waits' };
  if (t > track.end && track.leaves) return null;
  if (t >= track.end) return { ...row(n - 1), state: track.stays ? 'stays in the air' : track.leaves ? 'flies' : 'landed' };
  let low = 0, high = n - 1;
  while (high - low > 1) { const m = (low + high) >> 1; if (at[5 * m] <= t) low = m; else high = m; }
  const part = (t - at[5 * low]) / (at[5 * high] - at[5 * low]), a = row(low), b = row(high);
  const mix = (name) => a[name] + part * (b[name] - a[name]);
  return { e: mix('e'), n: mix('n'), z: mix('z'), agl: mix('agl'), state: 'flies' };
}

const inTheAir = (place) => !!place && (place.state === 'flies' || place.state === 'stays in the air');
const apart = (a, b) => Math.hypot(a.e - b.e, a.n - b.n, a.z - b.z);

// The nearest other vehicle in the air of those of the same kind, planned or flown: [its number, metres], or null.
function nearestOther(tracks, places, i) {
  let found = null;
  if (!inTheAir(places[i])) return null;
  for (let j = 0; j < tracks.length; j++) {
    if (j === i || tracks[j].flown !== tracks[i].flown || !inTheAir(places[j])) continue;
    const away = apart(places[i], places[j]);
    if (!found || away < found[1]) found = [j, away];
  }
  return found;
}

// A time of the time table: T+h:mm:ss.
function clockWords(t) {
  return `T+${duration(Math.floor(Math.max(0, t) + 1e-6))}`;
}

// Every height and distance of the replay in words; room is rounded down.
const metres = (value, datum) => (datum === 'AMSL' ? num(value, 0, units.amsl) : least(value, 0, units.height));

// The track nearest to a place in the plane: line `k`, its nearest sample `i`, and metres to the line itself, which lies
// between samples where they are far apart; null if there is no line.
function nearestTrack(lines, e, n) {
  let found = null;
  lines.forEach((line, k) => {
    for (let i = 0; i + 1 < line.s.length; i++) {
      const de = line.e[i + 1] - line.e[i], dn = line.n[i + 1] - line.n[i], square = de * de + dn * dn;
      const f = square > 0 ? Math.min(1, Math.max(0, ((e - line.e[i]) * de + (n - line.n[i]) * dn) / square)) : 0;
      const away = Math.hypot(line.e[i] + f * de - e, line.n[i] + f * dn - n);
      if (!found || away < found.away) found = { k, i: f < 0.5 ? i : i + 1, away };
    }
  });
  return found;
}

// The sample of a line where a vehicle is: near in space, and near in time where a line passes a place twice.
function sampleAt(line, place, since) {
  let best = Infinity, found = 0;
  for (let i = 0; i < line.s.length; i++) {
    const late = 0.5 * (line.t[i] - since);
    const away = (line.e[i] - place.e) ** 2 + (line.n[i] - place.n) ** 2 + (line.z[i] - place.z) ** 2 + late * late;
    if (away < best) { best = away; found = i; }
  }
  return found;
}
