// The map: the ground's shade and the user's own base map by MapLibre; all else is drawn over it.
import { byId } from './dom.js';
import { known, on, tell } from './hub.js';

const DETAIL = 16; // shapes are drawn in pixels of this zoom, from their origin
const DARK = matchMedia('(prefers-color-scheme: dark)');
const NO_GROUND = { type: 'background', id: 'paper', paint: {} };

let map = null, origin = null, shown = '', fitted = '', touched = false;

export function startMap() {
  map = new maplibregl.Map({
    container: 'map-frame', style: { version: 8, sources: {}, layers: [coloured(NO_GROUND)] },
    center: [0, 20], zoom: 1, maxZoom: 19, fadeDuration: 0, attributionControl: false, renderWorldCopies: false,
    dragRotate: false, pitchWithRotate: false, touchPitch: false, boxZoom: false, doubleClickZoom: false,
  });
  map.touchZoomRotate.disableRotation();
  map.keyboard.disableRotation();
  const canvas = map.getCanvas();
  canvas.setAttribute('aria-label', 'Map: arrow keys move it, plus and minus zoom, Enter puts a point in its middle');
  canvas.setAttribute('aria-roledescription', 'map');
  map.on('move', () => tell('moved'));
  map.on('resize', () => tell('moved'));
  map.on('moveend', () => tell('rested'));
  for (const kind of ['dragstart', 'zoomstart']) map.on(kind, (event) => { touched = touched || Boolean(event.originalEvent); });
  map.on('error', () => {}); // a tile beside the terrain is absent, which is no error
  byId('zoom-in').addEventListener('click', () => map.zoomIn({ duration: 150 }));
  byId('zoom-out').addEventListener('click', () => map.zoomOut({ duration: 150 }));
  byId('zoom-all').addEventListener('click', fit);
  DARK.addEventListener('change', () => { shown = ''; if (known.state) dress(known.state); });
  matchMedia('print').addEventListener('change', ({ matches }) => print(matches));
  return map;
}

// On paper the map has another size: it shows the whole mission there, and then what it showed before.
let onScreen = null;
function print(paper) {
  if (paper) onScreen = { center: map.getCenter(), zoom: map.getZoom() };
  map.resize();
  if (paper) fit(); else if (onScreen) map.jumpTo(onScreen);
  map.redraw();
}

// Listens last: the other parts of the page have their sizes by then.
export function showState() {
  on('state', (state) => {
    map.resize(); // the panel beside it may have changed
    dress(state);
    const whole = JSON.stringify([state.stage === 'empty', state.terrain && state.terrain.bounds, state.name]);
    if (whole === fitted || !state.bounds) return;
    fitted = whole;
    touched = false;
    fit();
  });
  on('plan', () => { // the first path may lead out of the picture, and the time line takes room of the map
    if (!touched) { map.resize(); fit(); }
    touched = true;
  });
}

export const frame = () => map.getCanvasContainer();
export const canvas = () => map.getCanvas();
export const panning = (yes) => (yes ? map.dragPan.enable() : map.dragPan.disable());

// Places are [lat, lon] with seven decimals, as autopilots store them: about a centimetre.
const place = (lat, lon) => [Number(lat.toFixed(7)), Number(lon.toFixed(7))];
const placeOf = ({ lat, lng }) => place(lat, lng);

export function placeAt(event) {
  const box = map.getCanvas().getBoundingClientRect();
  return placeOf(map.unproject([event.clientX - box.left, event.clientY - box.top]));
}
export function pixel([lat, lon]) {
  const spot = map.project([lon, lat]);
  return [spot.x, spot.y];
}
export const middle = () => placeOf(map.getCenter());
export const halfWay = (a, b) => place(0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]));
export function moved(from, dx, dy) {
  const [x, y] = pixel(from);
  return placeOf(map.unproject([x + dx, y + dy]));
}
// Metres of the ground from the left edge of the map to the right one.
export function across_m() {
  const box = map.getBounds(), [lat] = middle();
  return (Math.abs(box.getEast() - box.getWest()) * 40075016.7 * Math.cos((lat * Math.PI) / 180)) / 360;
}
export const size = () => [map.getCanvas().clientWidth, map.getCanvas().clientHeight];

function fit() {
  const { bounds } = known.state;
  if (!bounds) return;
  let [west, south, east, north] = bounds;
  for (const { line } of known.state.stage === 'mission' && known.plan ? known.plan.vehicles : []) {
    for (let i = 0; i + 2 < line.length; i += 3) {
      [south, north] = [Math.min(south, line[i]), Math.max(north, line[i])];
      [west, east] = [Math.min(west, line[i + 1]), Math.max(east, line[i + 1])];
    }
  }
  map.fitBounds([[west, south], [east, north]], { padding: { top: 40, bottom: 40, left: Math.min(130, size()[0] / 6), right: 56 }, animate: false });
}
export function goTo(place, zoom) {
  map.jumpTo({ center: [place[1], place[0]], zoom: zoom || map.getZoom() });
}

// -- shapes: local coordinates, in which a move of the map is one transformation ------------------------------------------

const world = ([lat, lon]) => {
  const s = Math.sin((Math.max(-85, Math.min(85, lat)) * Math.PI) / 180), all = 512 * 2 ** DETAIL;
  return [(lon / 360 + 0.5) * all, (0.5 - Math.log((1 + s) / (1 - s)) / (4 * Math.PI)) * all];
};

export function local(place) {
  if (!origin) origin = place;
  const [x, y] = world(place), [x0, y0] = world(origin);
  return [x - x0, y - y0];
}

// Metres of the ground in local coordinates.
export const metres = ([lat]) => (512 * 2 ** DETAIL) / (40075016.7 * Math.cos((lat * Math.PI) / 180));

export function transformation() {
  if (!origin) return '';
  const k = 2 ** (map.getZoom() - DETAIL), [x, y] = pixel(origin);
  return `matrix(${k} 0 0 ${k} ${x} ${y})`;
}

// -- ground -----------------------------------------------------------------------------------------------------------

function coloured(layer) {
  const dark = DARK.matches;
  if (layer.id === 'paper') layer.paint = { 'background-color': dark ? '#1a2027' : '#e9eff5' };
  if (layer.id === 'shade') layer.paint = {
    'hillshade-exaggeration': 0.55, 'hillshade-illumination-direction': 315,
    'hillshade-shadow-color': dark ? '#05070a' : '#4a3a28', 'hillshade-accent-color': dark ? '#0c1116' : '#7a6a55',
    'hillshade-highlight-color': dark ? '#8d9aa8' : '#ffffff',
  };
  if (layer.id === 'contours') layer.paint = {
    'line-color': dark ? '#c9b79a' : '#6b4a1f', 'line-opacity': dark ? 0.45 : 0.5,
    'line-width': ['case', ['get', 'fifth'], 1.2, 0.5],
  };
  if (layer.id === 'base') layer.paint = { 'raster-opacity': dark ? 0.55 : 0.85, 'raster-fade-duration': 0 };
  return layer;
}

function dress(state) {
  const { terrain, base } = state, now = JSON.stringify([terrain, base]);
  if (now === shown) return;
  shown = now;
  const sources = {}, layers = [coloured({ ...NO_GROUND })];
  const url = (tiles) => decodeURI(new URL(tiles, document.baseURI).href);
  if (base) {
    sources.base = { type: 'raster', tiles: [url(base.tiles)], tileSize: 256, minzoom: base.minzoom, maxzoom: base.maxzoom };
    layers.push(coloured({ id: 'base', type: 'raster', source: 'base' }));
  }
  if (terrain && !terrain.flat) {
    sources.ground = {
      type: 'raster-dem', encoding: 'terrarium', tileSize: 256, tiles: [url(terrain.tiles)],
      minzoom: terrain.minzoom, maxzoom: terrain.maxzoom, bounds: terrain.bounds,
    };
    layers.push(coloured({ id: 'shade', type: 'hillshade', source: 'ground' }));
    sources.contours = { type: 'geojson', data: { type: 'FeatureCollection', features: [] }, tolerance: 0 };
    layers.push(coloured({ id: 'contours', type: 'line', source: 'contours' }));
  }
  map.setStyle({ version: 8, sources, layers }, { diff: false });
  tell('dressed');
}

export const source = (id) => map.getSource(id);

// The tiles that are in the picture, as [z, x, y] of a zoom that is a whole number from `least` to `most`.
export function tilesShown(least, most) {
  const z = Math.max(least, Math.min(most, Math.floor(map.getZoom() + 0.5))), box = map.getBounds(), count = 2 ** z;
  const at = (lat, lon) => world([lat, lon]).map((v) => Math.max(0, Math.min(count - 1, Math.floor((v / (512 * 2 ** DETAIL)) * count))));
  const [west, north] = at(box.getNorth(), box.getWest()), [east, south] = at(box.getSouth(), box.getEast()), tiles = [];
  for (let y = north; y <= south; y++) for (let x = west; x <= east; x++) tiles.push([z, x, y]);
  return tiles;
}
