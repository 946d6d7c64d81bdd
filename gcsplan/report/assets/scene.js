// The view in space: its camera, its gestures of mouse and fingers, and its labels.
const MOST_LABELS = 300; // more would not be read, and each takes time in every frame

// `picture` is the address of the shaded ground. The answer redraws what has changed: the lines alone, or all.
function startScene(picture = () => document.querySelector('#map image').getAttribute('href')) {
  const figure = document.getElementById('scene');
  if (!figure) return null;
  const [canvas, over] = figure.querySelectorAll('canvas'), nothing = figure.querySelector('.nothing');
  const gl = canvas.getContext('webgl', { antialias: true, preserveDrawingBuffer: true, alpha: false });
  if (!gl) { nothing.textContent = 'This browser offers no WebGL: the map and the profiles show the same.'; return null; }
  nothing.remove();
  const pen = over.getContext('2d'), programs = {};
  for (const name of Object.keys(SHADERS)) programs[name] = program(gl, ...SHADERS[name]);
  let low, highest, block, meshes;
  const at = (e, n, z) => [e - ground.west, n - ground.south, z - low];
  const camera = { turn: -0.5, tilt: 0.75, far: 1.25 * Math.max(ground.width, ground.height), x: 0.5 * ground.width, y: 0.5 * ground.height };
  let stretch = data.exaggeration, pointed = null, scheduled = false, printing = false, matrix = null, size = [1, 1];
  const lift = () => 0.4 * stretch * highest;
  const home = { ...camera };

  // So far away, and moved so, that the whole block fills the figure.
  function fit() {
    size = [figure.clientWidth, figure.clientHeight];
    const corners = [0, 1].flatMap((a) => [0, 1].map((b) => [a * ground.width, b * ground.height, 0]));
    for (let j = 0; j < ground.rows; j += 6) for (let i = 0; i < ground.cols; i += 6) {
      const h = ground.z[j * ground.cols + i];
      if (!isNaN(h)) corners.push([(ground.width * i) / (ground.cols - 1), ground.height * (1 - j / (ground.rows - 1)), h - low]);
    }
    for (const line of data.lines) for (let i = 0; i < line.s.length; i += 10) corners.push(at(line.e[i], line.n[i], line.z[i]));
    for (const z of meshes.zones) corners.push(z.top);
    for (let k = 0; k < 12; k++) {
      matrix = look(eye(), [camera.x, camera.y, lift()], size[0] / size[1], camera.far);
      const seen = corners.map(project).filter((c) => c);
      if (seen.length < corners.length) { camera.far *= 1.5; continue; }
      const span = [0, 1].map((i) => [Math.min(...seen.map((c) => c[i])), Math.max(...seen.map((c) => c[i]))]);
      slideBy(0.5 * size[0] - 0.5 * (span[0][0] + span[0][1]), 0.52 * size[1] - 0.5 * (span[1][0] + span[1][1]));
      camera.far *= Math.max((span[0][1] - span[0][0]) / (0.94 * size[0]), (span[1][1] - span[1][0]) / (0.88 * size[1]));
    }
    Object.assign(home, camera);
  }

  const texture = gl.createTexture();
  const image = new Image();
  image.onload = () => {
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, image);
    for (const [key, value] of [[gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
      [gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR]]) gl.texParameteri(gl.TEXTURE_2D, key, value);
    redraw();
  };

  // What the numbers say now; the camera keeps its place over the middle of the ground.
  function take() {
    const known = [...ground.z].filter((z) => !isNaN(z));
    low = Math.min(...known);
    highest = Math.max(0, ...[...known, ...data.lines.flatMap((l) => l.z)].map((z) => z - low));
    for (const old of meshes ? [meshes.ground, meshes.skirt, ...meshes.zones.flatMap((z) => [z.faces, z.edges])] : []) old.free();
    freeTracks();
    meshes = build(gl, at, low);
    for (const view of block ? [camera, home] : []) {
      view.x += 0.5 * (ground.width - block.width);
      view.y += 0.5 * (ground.height - block.height);
    }
    block = { width: ground.width, height: ground.height };
    image.src = picture();
  }
  function freeTracks() {
    for (const t of meshes ? meshes.tracks : []) { t.line.free(); t.curtain.free(); }
  }
  function takeLines() {
    freeTracks();
    meshes.tracks = buildTracks(gl, at, low);
    redraw();
  }

  function redraw() {
    if (scheduled) return;
    scheduled = true;
    requestAnimationFrame(draw);
  }

  function project(p) {
    const [x, y, z] = [p[0], p[1], p[2] * stretch], m = matrix;
    const w = m[3] * x + m[7] * y + m[11] * z + m[15];
    if (w <= 0) return null;
    return [(0.5 + (0.5 * (m[0] * x + m[4] * y + m[8] * z + m[12])) / w) * size[0],
      (0.5 - (0.5 * (m[1] * x + m[5] * y + m[9] * z + m[13])) / w) * size[1]];
  }

  function eye() {
    const flat = Math.cos(camera.tilt) * camera.far;
    return [camera.x + flat * Math.sin(camera.turn), camera.y - flat * Math.cos(camera.turn), lift() + Math.sin(camera.tilt) * camera.far];
  }

  // Whether ground stands between the eye and a point; a few steps are enough for labels.
  function hidden(p) {
    const from = eye();
    for (let k = 1; k <= 48; k++) {
      const f = (k / 48) ** 2, x = p[0] + f * (from[0] - p[0]), y = p[1] + f * (from[1] - p[1]);
      const z = p[2] * stretch + f * (from[2] - p[2] * stretch), g = ground.at(x + ground.west, y + ground.south);
      if (isNaN(g)) continue;
      if ((g - low) * stretch > z + 0.002 * ground.width) return true;
    }
    return false;
  }

  function draw() {
    scheduled = false;
    if (!figure.clientWidth) return;
    const ratio = Math.min(2, window.devicePixelRatio || 1), style = getComputedStyle(figure);
    size = [figure.clientWidth, figure.clientHeight];
    for (const c of [canvas, over]) {
      if (c.width !== Math.round(size[0] * ratio) || c.height !== Math.round(size[1] * ratio)) {
        c.width = Math.round(size[0] * ratio);
        c.height = Math.round(size[1] * ratio);
      }
    }
    matrix = look(eye(), [camera.x, camera.y, lift()], size[0] / size[1], camera.far);
    const colour = (name, alpha) => rgba(style.getPropertyValue(name), alpha);
    const sky = colour('--sky', 1);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(sky[0], sky[1], sky[2], 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    const use = (name) => {
      const p = programs[name];
      gl.useProgram(p.it);
      gl.uniformMatrix4fv(p.m, false, matrix);
      gl.uniform1f(p.stretch, stretch);
      return p;
    };
    let p = use('ground');
    gl.uniform4f(p.box, ground.width, ground.height, 0, 0);
    gl.uniform1f(p.tone, parseFloat(style.getPropertyValue('--tone')));
    gl.bindTexture(gl.TEXTURE_2D, texture);
    meshes.ground.draw(p);
    p = use('plain');
    const paint = (mesh, c) => { gl.uniform4fv(p.colour, c); mesh.draw(p); };
    paint(meshes.skirt, colour('--skirt', 1));
    p = use('line');
    gl.uniform2f(p.size, ...size);
    meshes.tracks.forEach((t, k) => {
      gl.uniform2f(p.width, 7, 0.0006);
      paint(t.line, colour('--casing', 1));
      gl.uniform2f(p.width, 4, 0.0009);
      paint(t.line, colour(hue(data.lines[k]), 1));
    });
    p = use('plain');
    gl.enable(gl.BLEND);
    for (const z of meshes.zones) paint(z.edges, colour('--zone-line', 0.9));
    gl.depthMask(false);
    for (const z of meshes.zones) paint(z.faces, colour('--zone', 0.26));
    meshes.tracks.forEach((t, k) => paint(t.curtain, colour(hue(data.lines[k]), 0.22)));
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    labels(ratio, style);
  }

  function labels(ratio, style) {
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, size[0], size[1]);
    if (printing) pen.drawImage(canvas, 0, 0, size[0], size[1]); // what WebGL drew does not reach the paper by itself
    pen.textAlign = 'center';
    pen.lineJoin = 'round';
    const drawn = [], text = style.getPropertyValue('--text'), halo = style.getPropertyValue('--paper');
    // A label beside a symbol of radius r; all are written last, each where there is room.
    const write = (words, c, r, bold, colour) => {
      if (c[0] < 0 || c[0] > size[0] || c[1] < 0 || c[1] > size[1]) return;
      pen.font = `${bold ? '600 ' : ''}12px system-ui, sans-serif`;
      drawn.push({ x: c[0], y: c[1], r, w: pen.measureText(words).width, h: 14, words, bold: !!bold, font: pen.font, colour: colour || text });
    };
    const dot = (c, r, fill) => {
      pen.beginPath();
      pen.arc(c[0], c[1], r, 0, 7);
      pen.fillStyle = fill;
      pen.strokeStyle = halo;
      pen.lineWidth = 1.5;
      pen.fill();
      pen.stroke();
    };
    for (const z of meshes.zones) { const c = project(z.top); if (c && !hidden(z.top)) write(z.name, c, 0, true, style.getPropertyValue('--zone-text')); }
    data.lines.forEach((line, k) => {
      const colour = style.getPropertyValue(hue(line)), last = line.s.length - 1;
      for (const [i, words] of [[0, 'start'], [last, 'goal']]) {
        const p = at(line.e[i], line.n[i], line.z[i]), c = project(p);
        if (!c || hidden(p)) continue;
        dot(c, 5, colour);
        write(data.lines.length > 1 ? `${line.name} ${words}` : words, c, 5, true);
      }
      line.legs.forEach((leg, j) => {
        const i = line.ends[j], p = at(line.e[i], line.n[i], line.z[i]), c = leg.kind === 'cruise' && project(p);
        if (!c || hidden(p)) return;
        dot(c, 3, colour);
        write(String(leg.seq), c, 3);
      });
    });
    for (const line of data.lines) for (const [e, n, z, words] of line.broken) {
      const p = at(e, n, z), c = project(p);
      if (!c) continue;
      dot(c, 6, style.getPropertyValue('--bad'));
      write(words, c, 6, true, style.getPropertyValue('--bad'));
    }
    if (replay.shown && !printing) replay.tracks.forEach((track, i) => {
      const place = replay.places[i], c = place && project(at(place.e, place.n, place.z));
      if (!c) return;
      dot(c, 7, hollow(track) ? halo : style.getPropertyValue(`--t${track.k % 8}`));
      if (hollow(track)) dot(c, 3, style.getPropertyValue(`--t${track.k % 8}`));
      else if (replay.tracks.length > 1) write(track.name, c, 7, true);
    });
    if (pointed) {
      const [k, i] = pointed, line = data.lines[k], c = project(at(line.e[i], line.n[i], line.z[i]));
      if (c) dot(c, 7, style.getPropertyValue('--cursor'));
    }
    // Which way is north: the tip of an arrow on the ground.
    const c = project([camera.x, camera.y, lift() / stretch]), d = project([camera.x, camera.y + 0.02 * camera.far, lift() / stretch]);
    if (c && d) {
      const long = Math.hypot(d[0] - c[0], d[1] - c[1]) || 1, u = [(d[0] - c[0]) / long, (d[1] - c[1]) / long], o = [30, size[1] - 34];
      pen.strokeStyle = text;
      pen.lineWidth = 2;
      pen.beginPath();
      pen.moveTo(o[0] - 16 * u[0], o[1] - 16 * u[1]);
      pen.lineTo(o[0] + 12 * u[0], o[1] + 12 * u[1]);
      for (const side of [-1, 1]) {
        pen.moveTo(o[0] + 12 * u[0], o[1] + 12 * u[1]);
        pen.lineTo(o[0] + 5 * u[0] - side * 4 * u[1], o[1] + 5 * u[1] + side * 4 * u[0]);
      }
      pen.stroke();
      write('N', [o[0] + 20 * u[0], o[1] + 20 * u[1] + 8], 0, true);
    }
    const first = drawn.reverse().sort((a, b) => b.bold - a.bold).slice(0, MOST_LABELS);
    layLabels(first, ...size, []).forEach((spot, i) => {
      if (!spot) return;
      const { words, font, w, colour } = first[i], x = spot[0] + 0.5 * w, y = spot[1] + 11;
      Object.assign(pen, { font, lineWidth: 3, strokeStyle: halo, fillStyle: colour });
      pen.strokeText(words, x, y);
      pen.fillText(words, x, y);
    });
  }

  // The ground under a pixel: along the ray in small steps, then halved.
  function under(x, y) {
    const inverse = invert(matrix), u = (2 * x) / size[0] - 1, v = 1 - (2 * y) / size[1];
    const far = (depth) => { const q = times(inverse, [u, v, depth, 1]); return [q[0] / q[3], q[1] / q[3], q[2] / q[3]]; };
    const a = far(-1), b = far(1), spot = (f) => a.map((s, i) => s + f * (b[i] - s));
    const above = (f) => {
      const s = spot(f), g = ground.at(s[0] + ground.west, s[1] + ground.south);
      return isNaN(g) ? NaN : s[2] - (g - low) * stretch;
    };
    const near = Math.hypot(...spot(1).map((s, i) => s - a[i])), step = Math.min(ground.width, ground.height) / 150 / near;
    let last = NaN;
    const ends = [0, 1].map((f) => spot(f)[2]), top = stretch * highest + ground.width;
    const begin = Math.max(0, (ends[0] - top) / (ends[0] - ends[1] || 1));
    for (let f = begin, k = 0; f <= 1 && k < 4000; f += step, k++) {
      const now = above(f);
      if (last > 0 && now <= 0) {
        let p = f - step, q = f;
        for (let j = 0; j < 12; j++) { const r = 0.5 * (p + q); if (above(r) > 0) p = r; else q = r; }
        const s = spot(q);
        return [s[0] + ground.west, s[1] + ground.south];
      }
      last = now;
    }
    return null;
  }

  gestures(figure, {
    movable: () => true,
    drag: (dx, dy, event) => {
      if (event.buttons === 2 || event.shiftKey) { slide(dx, dy); return; }
      camera.turn -= dx * 0.007;
      if (event.pointerType === 'mouse') camera.tilt = Math.min(1.55, Math.max(0.08, camera.tilt + dy * 0.006));
      redraw();
    },
    slide: (dx, dy) => slide(dx, dy),
    pinch: (factor) => {
      camera.far = Math.min(4 * home.far, Math.max(0.03 * home.far, camera.far / factor));
      redraw();
    },
    point: (event) => {
      if (!matrix) return;
      const box = canvas.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
      let best = 14, found = null;
      data.lines.forEach((line, k) => {
        for (let i = 0; i < line.s.length; i++) {
          const c = project(at(line.e[i], line.n[i], line.z[i])), away = c ? Math.hypot(c[0] - x, c[1] - y) : best;
          if (away < best) { best = away; found = [k, i]; }
        }
      });
      if (found) { pointAt(...found); tip.rows(event, sampleRows(...found)); return; }
      nowhere();
      const spot = under(x, y);
      if (spot) tip.rows(event, groundRows(...spot, nearestTrack(data.lines, ...spot))); else tip.hide();
    },
    leave: () => { tip.hide(); nowhere(); },
  });
  function slide(dx, dy) {
    slideBy(dx, dy);
    redraw();
  }
  function slideBy(dx, dy) {
    const metres = (0.62 * camera.far) / (size[1] * Math.min(1, size[0] / size[1] / 1.2)), c = Math.cos(camera.turn), s = Math.sin(camera.turn);
    const ahead = dy * metres / Math.max(0.35, Math.sin(camera.tilt)), aside = -dx * metres;
    camera.x += aside * c - ahead * s;
    camera.y += aside * s + ahead * c;
  }
  figure.addEventListener('contextmenu', (event) => event.preventDefault());
  canvas.addEventListener('keydown', (event) => {
    const step = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.08], ArrowDown: [0, -0.08] }[event.key];
    if (event.key === '+' || event.key === '-') camera.far *= event.key === '+' ? 0.85 : 1.18;
    else if (!step) return;
    else { camera.turn += step[0]; camera.tilt = Math.min(1.55, Math.max(0.08, camera.tilt + step[1])); }
    event.preventDefault();
    redraw();
  });
  const tools = document.querySelector('.tools[data-for="scene"]');
  tools.hidden = false;
  tools.addEventListener('click', (event) => {
    const what = event.target.dataset.do;
    if (what === 'home') Object.assign(camera, home);
    else if (what) camera.far = Math.max(0.03 * home.far, camera.far / (what === 'in' ? 1.4 : 1 / 1.4));
    redraw();
  });
  const control = document.querySelector('.stretch'), range = control.querySelector('input');
  control.hidden = false;
  const show = () => { control.querySelector('output').textContent = num(stretch, 1); };
  range.value = stretch;
  range.addEventListener('input', () => { stretch = +range.value; show(); redraw(); });
  show();
  take();
  fit();
  new ResizeObserver(redraw).observe(figure);
  movers.push(redraw);
  watchers.push((k, i) => { pointed = k < 0 ? null : [k, i]; redraw(); });
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redraw);
  for (const when of ['beforeprint', 'afterprint']) window.addEventListener(when, () => { printing = when === 'beforeprint'; draw(); });
  return { takeLines, takeAll: () => { take(); pointed = null; redraw(); } };
}

// The colour of a line; one that is not judged yet has none of its own.
const hue = (line) => (line.draft ? '--quiet' : `--t${line.index % 8}`);
