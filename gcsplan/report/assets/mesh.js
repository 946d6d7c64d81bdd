// What the view in space is drawn with: programs for the graphics processor, meshes, and a little algebra.
const SHADERS = {
  ground: [
    `attribute vec3 p; uniform mat4 m; uniform vec4 box; uniform float stretch; varying vec2 uv;
     void main() { uv = vec2(p.x / box.x, 1.0 - p.y / box.y); gl_Position = m * vec4(p.xy, p.z * stretch, 1.0); }`,
    `precision mediump float; uniform sampler2D picture; uniform float tone; varying vec2 uv;
     void main() { gl_FragColor = vec4(texture2D(picture, uv).rgb * tone, 1.0); }`,
  ],
  plain: [
    `attribute vec3 p; uniform mat4 m; uniform float stretch;
     void main() { gl_Position = m * vec4(p.xy, p.z * stretch, 1.0); }`,
    `precision mediump float; uniform vec4 colour; void main() { gl_FragColor = colour; }`,
  ],
  // A line of the same width everywhere: each piece is a rectangle, widened on the screen.
  line: [
    `attribute vec3 p; attribute vec3 q; attribute vec2 corner; uniform mat4 m; uniform float stretch; uniform vec2 size;
     uniform vec2 width; // in pixels, and by how much it is drawn before what it lies on
     void main() {
       vec4 a = m * vec4(p.xy, p.z * stretch, 1.0), b = m * vec4(q.xy, q.z * stretch, 1.0);
       vec2 along = (b.xy / b.w - a.xy / a.w) * size;
       along = length(along) > 1e-4 ? normalize(along) : vec2(1.0, 0.0);
       vec4 at = corner.x < 0.5 ? a : b;
       vec2 off = (vec2(-along.y, along.x) * corner.y + along * (2.0 * corner.x - 1.0) * 0.5) * width.x / size;
       gl_Position = vec4(at.xy + off * at.w, at.z - width.y * at.w, at.w);
     }`,
    `precision mediump float; uniform vec4 colour; void main() { gl_FragColor = colour; }`,
  ],
};

function program(gl, vertex, fragment) {
  const it = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(it, shader);
  }
  gl.linkProgram(it);
  const out = { it, attributes: {} };
  for (const name of ['m', 'stretch', 'box', 'tone', 'colour', 'size', 'width']) out[name] = gl.getUniformLocation(it, name);
  for (const name of ['p', 'q', 'corner']) out.attributes[name] = gl.getAttribLocation(it, name);
  return out;
}

// Buffers with their layout, ready to be drawn by any of the programs.
function mesh(gl, mode, columns, indices) {
  const buffers = Object.entries(columns).map(([name, [width, values]]) => {
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.STATIC_DRAW);
    return [name, width, buffer];
  });
  const order = gl.createBuffer();
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, order);
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint16Array(indices), gl.STATIC_DRAW);
  return {
    free() { for (const made of [...buffers.map((b) => b[2]), order]) gl.deleteBuffer(made); },
    draw(p) {
      for (let place = 0; place < 3; place++) gl.disableVertexAttribArray(place); // another program's buffer may be gone
      for (const [name, width, buffer] of buffers) {
        const place = p.attributes[name];
        if (place < 0) continue;
        gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
        gl.enableVertexAttribArray(place);
        gl.vertexAttribPointer(place, width, gl.FLOAT, false, 0, 0);
      }
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, order);
      gl.drawElements(mode, indices.length, gl.UNSIGNED_SHORT, 0);
    },
  };
}

function build(gl, at, low) {
  const { cols, rows, z } = ground, p = [], faces = [];
  for (let j = 0; j < rows; j++) for (let i = 0; i < cols; i++) {
    const h = z[j * cols + i];
    p.push((ground.width * i) / (cols - 1), ground.height * (1 - j / (rows - 1)), isNaN(h) ? 0 : h - low);
  }
  for (let j = 0; j + 1 < rows; j++) for (let i = 0; i + 1 < cols; i++) {
    const a = j * cols + i, b = a + 1, c = a + cols, d = c + 1;
    if ([a, b, c, d].some((k) => isNaN(z[k]))) continue;
    faces.push(a, c, b, b, c, d);
  }
  const skirt = [], skirtFaces = [], deep = -0.01 * Math.max(ground.width, ground.height);
  const rim = [];
  for (let i = 0; i < cols; i++) rim.push(i);
  for (let j = 1; j < rows; j++) rim.push(j * cols + cols - 1);
  for (let i = cols - 2; i >= 0; i--) rim.push((rows - 1) * cols + i);
  for (let j = rows - 2; j >= 0; j--) rim.push(j * cols);
  rim.forEach((k, i) => {
    skirt.push(p[3 * k], p[3 * k + 1], p[3 * k + 2], p[3 * k], p[3 * k + 1], deep);
    if (i) skirtFaces.push(2 * i - 2, 2 * i - 1, 2 * i, 2 * i, 2 * i - 1, 2 * i + 1);
  });
  const zones = data.zones.map(zoneMesh);
  return { ground: mesh(gl, gl.TRIANGLES, { p: [3, p] }, faces), skirt: mesh(gl, gl.TRIANGLES, { p: [3, skirt] }, skirtFaces), tracks: buildTracks(gl, at, low), zones };

  function zoneMesh(zone) {
    const q = [], n = zone.at.length / 3;
    const middle = [0, 0, -1e9];
    for (let i = 0; i < n; i++) {
      const s = [zone.at[3 * i], zone.at[3 * i + 1], zone.at[3 * i + 2] - low];
      q.push(...s);
      middle[0] += s[0] / n;
      middle[1] += s[1] / n;
      middle[2] = Math.max(middle[2], s[2]);
    }
    return { name: zone.name, top: middle, faces: mesh(gl, gl.TRIANGLES, { p: [3, q] }, zone.faces), edges: mesh(gl, gl.LINES, { p: [3, q] }, zone.edges) };
  }
}

function buildTracks(gl, at, low) {
  return data.lines.map((line) => {
    const q = line.s.map((_, i) => at(line.e[i], line.n[i], line.z[i]));
    const columns = { p: [3, []], q: [3, []], corner: [2, []] }, order = [], sheet = [], sheetFaces = [];
    for (let i = 0; i + 1 < q.length; i++) {
      const base = 4 * i;
      for (const corner of [[0, -1], [0, 1], [1, -1], [1, 1]]) {
        columns.p[1].push(...q[i]);
        columns.q[1].push(...q[i + 1]);
        columns.corner[1].push(...corner);
      }
      order.push(base, base + 1, base + 2, base + 2, base + 1, base + 3);
    }
    q.forEach((s, i) => {
      sheet.push(...s, s[0], s[1], line.g[i] === null ? s[2] : line.g[i] - low);
      if (i) sheetFaces.push(2 * i - 2, 2 * i - 1, 2 * i, 2 * i, 2 * i - 1, 2 * i + 1);
    });
    return { line: mesh(gl, gl.TRIANGLES, columns, order), curtain: mesh(gl, gl.TRIANGLES, { p: [3, sheet] }, sheetFaces) };
  });
}

// -- a little algebra; matrices are columns, as WebGL wants them ---------------------------------------------------------
function look(eye, target, aspect, far) {
  const f = unit(eye.map((v, i) => target[i] - v)), s = unit(cross(f, [0, 0, 1])), u = cross(s, f);
  const t = 1 / Math.tan(0.3), near = 0.02 * far, deep = 8 * far;
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const wide = Math.min(1, aspect / 1.2); // on a narrow screen the width is what must fit
  const view = [s[0], u[0], -f[0], 0, s[1], u[1], -f[1], 0, s[2], u[2], -f[2], 0, -dot(s, eye), -dot(u, eye), dot(f, eye), 1];
  const lens = [(t * wide) / aspect, 0, 0, 0, 0, t * wide, 0, 0, 0, 0, (deep + near) / (near - deep), -1, 0, 0, (2 * deep * near) / (near - deep), 0];
  return product(lens, view);
}
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const l = Math.hypot(...a) || 1; return a.map((v) => v / l); };
const times = (m, v) => [0, 1, 2, 3].map((i) => m[i] * v[0] + m[4 + i] * v[1] + m[8 + i] * v[2] + m[12 + i] * v[3]);
const product = (a, b) => [0, 1, 2, 3].flatMap((j) => times(a, b.slice(4 * j, 4 * j + 4)));

// By Gauss and Jordan.
function invert(m) {
  const a = [0, 1, 2, 3].map((i) => [...[0, 1, 2, 3].map((j) => m[4 * j + i]), ...[0, 1, 2, 3].map((j) => +(i === j))]);
  for (let i = 0; i < 4; i++) {
    let best = i;
    for (let r = i + 1; r < 4; r++) if (Math.abs(a[r][i]) > Math.abs(a[best][i])) best = r;
    [a[i], a[best]] = [a[best], a[i]];
    const d = a[i][i];
    a[i] = a[i].map((v) => v / d);
    for (let r = 0; r < 4; r++) if (r !== i) { const f = a[r][i]; a[r] = a[r].map((v, c) => v - f * a[i][c]); }
  }
  return [0, 1, 2, 3].flatMap((j) => [0, 1, 2, 3].map((i) => a[i][4 + j]));
}

function rgba(css, alpha) {
  const hex = css.trim().slice(1);
  return [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255).concat(alpha);
}
