// Contours of the ground in the picture, tile by tile as the server makes them, and how far they are apart in height.
import { byId } from './dom.js';
import { known, on, worded } from './hub.js';
import { source, tilesShown } from './map.js';

const MOST_TILES = 48, MOST_KEPT = 256; // in the picture, and in all
const kept = new Map(); // features by address

let shown = '';

export function startContours() {
  on('rested', draw);
  on('dressed', () => { shown = ''; draw(); });
  on('state', draw);
}

async function draw() {
  const { state } = known, terrain = state && state.terrain, ground = source('contours');
  attribute(state, terrain && ground ? terrain.contours_m : null);
  if (!terrain || !ground) return;
  const tiles = tilesShown(terrain.minzoom, terrain.maxzoom);
  if (tiles.length > MOST_TILES) return;
  const urls = tiles.map(([z, x, y]) => terrain.contours.replace('{z}', z).replace('{x}', x).replace('{y}', y));
  const now = urls.join(' ');
  if (now === shown) return;
  shown = now;
  const found = await Promise.all(urls.map(features));
  if (shown !== now || source('contours') !== ground) return; // the map has moved on
  ground.setData({ type: 'FeatureCollection', features: found.flat() });
}

async function features(url) {
  if (!kept.has(url)) {
    let made = [];
    try {
      const answer = await fetch(url);
      if (answer.ok) made = (await answer.json()).features;
      else if (answer.status !== 404) return made; // too many at once: the next rest fetches it
    } catch { return made; }
    kept.set(url, made);
    if (kept.size > MOST_KEPT) kept.delete(kept.keys().next().value);
  }
  return kept.get(url);
}

function attribute(state, intervals) {
  const base = state && state.base ? state.base.attribution : '', zoom = tilesShown(0, 15)[0][0];
  const apart = intervals ? `contours every ${worded(intervals[zoom], 0, 'height')}` : '';
  byId('attribution').textContent = [apart, base].filter(Boolean).join(' · ');
}
