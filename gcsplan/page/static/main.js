// The page to plan on: each part starts on its own, and the connection last.
import { byId } from './dom.js';
import { on } from './hub.js';
import { connect } from './link.js';
import { banner, startBar } from './bar.js';
import { startContours } from './contours.js';
import { startDrop } from './drop.js';
import { startFromNothing } from './start.js';
import { startFleet } from './fleet.js';
import { startFly } from './fly.js';
import { startGrips } from './grips.js';
import { startHints } from './hints.js';
import { startKeys } from './keys.js';
import { startLimits } from './limits.js';
import { showState, startMap } from './map.js';
import { startModes } from './modes.js';
import { startPlaces } from './places.js';
import { startProfile } from './profile.js';
import { startReplayBar } from './replaybar.js';
import { startResult } from './result.js';
import { startRoute } from './route.js';
import { startScenery } from './scenery.js';
import { startShapes } from './shapes.js';
import { startSpace } from './space.js';
import { startTimeline } from './timeline.js';
import { startVehicles } from './vehicles.js';
import { startZoneList } from './zonelist.js';
import { startZones } from './zones.js';

function start() {
  startBar();
  try {
    startMap();
  } catch (error) {
    banner('map', `The map needs WebGL, which this browser does not offer: ${error.message}`, [], 'bad');
    return;
  }
  startContours();
  startShapes();
  startGrips();
  startVehicles();
  startHints();
  startModes();
  startRoute();
  startZones();
  startProfile();
  startScenery();
  startTimeline();
  startReplayBar();
  startSpace();
  const panel = byId('panel'), fly = startFly(), parts = [startResult(), startFleet(), startPlaces(), startZoneList(), startLimits(), startKeys(), fly];
  on('state', (state) => { if (state.stage !== 'empty' && !panel.contains(parts[0])) panel.replaceChildren(...parts); });
  startFromNothing(panel);
  on('state', (state) => { if (state.stage === 'empty' && !panel.contains(fly)) panel.append(fly); }); // behind the form
  startDrop();
  showState();
  connect();
  on('state', () => { document.documentElement.dataset.ready = 'yes'; });
}

start();
