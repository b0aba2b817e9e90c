// A small viewer of triangle meshes: turn, move, zoom, show and hide. WebGL 2, nothing else.
const viewer = (() => {
  "use strict";
  const byId = (id) => document.getElementById(id);
  const canvas = byId("canvas");
  const scene = JSON.parse(byId("scene").textContent);
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true });

  const say = (text) => {
    byId("message").textContent = text;
    byId("message").hidden = false;
  };
  if (!gl) {
    say("This browser does not support WebGL 2, so there is no 3D view. The rest of the page is complete.");
    return null;
  }

  // ---- meshes ------------------------------------------------------------------------------------------------

  const bytes = (base64) => Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));

  /** Unit vertex normals, weighted by area, from positions (`stride` numbers a vertex) and their scale. */
  function vertexNormals(positions, stride, size, indices) {
    const normals = new Float32Array((positions.length / stride) * 3);
    const edge = (p, q, k) => (positions[stride * q + k] - positions[stride * p + k]) * size[k];
    for (let t = 0; t < indices.length; t += 3) {
      const [a, b, c] = [indices[t], indices[t + 1], indices[t + 2]];
      const ux = edge(a, b, 0), uy = edge(a, b, 1), uz = edge(a, b, 2);
      const vx = edge(a, c, 0), vy = edge(a, c, 1), vz = edge(a, c, 2);
      const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
      for (const i of [a, b, c]) {
        normals[3 * i] += x;
        normals[3 * i + 1] += y;
        normals[3 * i + 2] += z;
      }
    }
    for (let i = 0; i < normals.length; i += 3) {
      const length = Math.hypot(normals[i], normals[i + 1], normals[i + 2]) || 1;
      for (let k = 0; k < 3; k++) normals[i + k] /= length;
    }
    return normals;
  }

  function buffer(target, data) {
    const made = gl.createBuffer();
    gl.bindBuffer(target, made);
    gl.bufferData(target, data, gl.STATIC_DRAW);
    return made;
  }

  const geometries = scene.geometries.map((packed) => {
    const positions = new Uint16Array(bytes(packed.positions).buffer);
    const indices = new Uint32Array(bytes(packed.indices).buffer);
    return {
      low: packed.low,
      size: packed.size,
      positions: buffer(gl.ARRAY_BUFFER, positions),
      normals: buffer(gl.ARRAY_BUFFER, vertexNormals(positions, 4, packed.size, indices)),
      indices: buffer(gl.ELEMENT_ARRAY_BUFFER, indices),
      triangles: indices,
      placed: false, // whether its positions are floats, in metres
      motion: packed.shapes ? unpackMotion(packed, positions) : null,
    };
  });

  /** The mean of a moving mesh [m], three numbers a vertex, and the shapes that are added to it. */
  function unpackMotion(packed, positions) {
    const mean = new Float32Array((positions.length / 4) * 3);
    for (let i = 0; i < mean.length; i++) {
      const k = i % 3;
      mean[i] = packed.low[k] + (packed.size[k] * positions[4 * ((i - k) / 3) + k]) / 65535;
    }
    const shapes = packed.shapes.map((shape) => new Int16Array(bytes(shape).buffer));
    return { mean, shapes, step: packed.step, weights: packed.weights };
  }

  /** Put the vertices of a mesh at these places [m], three numbers each. */
  function place(geometry, places) {
    geometry.placed = true;
    for (const [data, into] of [[places, "positions"], [vertexNormals(places, 3, [1, 1, 1], geometry.triangles), "normals"]]) {
      gl.bindBuffer(gl.ARRAY_BUFFER, geometry[into]);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    }
  }

  /** Put a moving mesh at a mean of its frames, given as pairs of a frame and its share. */
  function blend(geometry, shares) {
    const motion = geometry.motion;
    const placed = motion.mean.slice();
    motion.shapes.forEach((shape, k) => {
      const weight = motion.step * shares.reduce((sum, [frame, share]) => sum + share * motion.weights[frame][k], 0);
      for (let i = 0; i < placed.length; i++) placed[i] += weight * shape[i];
    });
    place(geometry, placed);
  }

  /** Put a moving mesh where it is in a frame; between two frames, in between. */
  function moveTo(geometry, frame) {
    const last = geometry.motion.weights.length - 1;
    const first = Math.min(Math.floor(frame), last);
    blend(geometry, [[first, 1 - (frame - first)], [Math.min(first + 1, last), frame - first]]);
  }

  const channels = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);
  const layers = scene.layers.map((layer) => ({
    ...layer,
    shape: geometries[layer.geometry],
    flat: layer.color ? channels(layer.color) : null,
    painted: layer.colors ? buffer(gl.ARRAY_BUFFER, bytes(layer.colors)) : null,
    laid: layer.places ? buffer(gl.ARRAY_BUFFER, bytes(layer.places)) : null,
    skin: layer.picture ? texture(layer.picture) : null,
  }));

  /** A texture that takes its picture when the browser has decoded it; until then `ready` is false. */
  function texture(address) {
    const skin = { made: gl.createTexture(), ready: false };
    const image = new Image();
    image.onload = () => {
      gl.bindTexture(gl.TEXTURE_2D, skin.made);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
      gl.generateMipmap(gl.TEXTURE_2D);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
      const sharper = gl.getExtension("EXT_texture_filter_anisotropic");
      if (sharper) gl.texParameterf(gl.TEXTURE_2D, sharper.TEXTURE_MAX_ANISOTROPY_EXT, 8);
      skin.ready = true;
      draw();
    };
    image.src = address;
    return skin;
  }

  // ---- drawing -----------------------------------------------------------------------------------------------

  const VERTEX = `#version 300 es
    in vec3 position; in vec3 normal; in vec3 color; in vec2 place;
    uniform vec3 low, size; uniform vec4 places; uniform mat4 eye, lens;
    out vec3 towards; out vec3 shade; out vec2 at;
    void main() {
      vec4 placed = eye * vec4(low + size * position, 1.0);
      towards = mat3(eye) * normal;
      shade = color;
      at = places.xy + places.zw * place;
      gl_Position = lens * placed;
    }`;
  const FRAGMENT = `#version 300 es
    precision highp float;
    uniform sampler2D picture; uniform bool skinned;
    in vec3 towards; in vec3 shade; in vec2 at; out vec4 pixel;
    void main() {
      vec3 n = normalize(towards) * (gl_FrontFacing ? 1.0 : -1.0);
      float light = 0.40 * (0.75 + 0.25 * n.y)
        + 0.64 * max(dot(n, normalize(vec3(-0.45, 0.55, 0.70))), 0.0)
        + 0.22 * max(dot(n, normalize(vec3(0.75, 0.15, 0.65))), 0.0);
      vec3 own = skinned ? texture(picture, at).rgb : shade;
      pixel = vec4(own * min(light, 1.0) * (gl_FrontFacing ? 1.0 : 0.7), 1.0);
    }`;

  function compile(kind, source) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    return shader;
  }
  const program = gl.createProgram();
  gl.attachShader(program, compile(gl.VERTEX_SHADER, VERTEX));
  gl.attachShader(program, compile(gl.FRAGMENT_SHADER, FRAGMENT));
  ["position", "normal", "color", "place"].forEach((name, slot) => gl.bindAttribLocation(program, slot, name));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
    say("The 3D view does not work with this graphics driver. The rest of the page is complete.");
    return null;
  }
  const uniform = (name) => gl.getUniformLocation(program, name);
  const [lowAt, sizeAt, eyeAt, lensAt, placesAt, skinnedAt] = ["low", "size", "eye", "lens", "places", "skinned"].map(uniform);

  const FIELD = (30 * Math.PI) / 180; // of view, vertical
  const camera = { turn: 0, tilt: 0, distance: 1, target: [0, 0, 0], radius: 1 };

  /** Right, up, and from the target to the eye, in the world. */
  function axes() {
    const [s, c, t, u] = [Math.sin(camera.turn), Math.cos(camera.turn), Math.sin(camera.tilt), Math.cos(camera.tilt)];
    return [[c, 0, -s], [-s * t, u, -c * t], [s * u, t, c * u]];
  }

  function eyeMatrix() {
    const [right, up, back] = axes();
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const shift = [-dot(right, camera.target), -dot(up, camera.target), -dot(back, camera.target) - camera.distance];
    return [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, ...shift, 1];
  }

  function lensMatrix() {
    const far = camera.distance + 4 * camera.radius;
    const near = Math.max(camera.distance - 4 * camera.radius, 0.01 * camera.distance);
    const zoom = 1 / Math.tan(FIELD / 2);
    const aspect = canvas.width / canvas.height;
    return [zoom / aspect, 0, 0, 0, 0, zoom, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
  }

  function attribute(slot, data, count, type, normalized, stride) {
    gl.bindBuffer(gl.ARRAY_BUFFER, data);
    gl.enableVertexAttribArray(slot);
    gl.vertexAttribPointer(slot, count, type, normalized, stride, 0);
  }

  function draw() {
    const sharp = Math.min(window.devicePixelRatio || 1, 2);
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * sharp));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * sharp));
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(program);
    gl.uniformMatrix4fv(eyeAt, false, eyeMatrix());
    gl.uniformMatrix4fv(lensAt, false, lensMatrix());
    for (const layer of layers.filter((one) => one.visible)) {
      const shape = layer.shape;
      gl.uniform3fv(lowAt, shape.placed ? [0, 0, 0] : shape.low);
      gl.uniform3fv(sizeAt, shape.placed ? [1, 1, 1] : shape.size);
      if (shape.placed) attribute(0, shape.positions, 3, gl.FLOAT, false, 0);
      else attribute(0, shape.positions, 3, gl.UNSIGNED_SHORT, true, 8);
      attribute(1, shape.normals, 3, gl.FLOAT, false, 0);
      const skinned = Boolean(layer.skin && layer.skin.ready);
      gl.uniform1i(skinnedAt, skinned);
      if (skinned) {
        gl.bindTexture(gl.TEXTURE_2D, layer.skin.made);
        gl.uniform4f(placesAt, ...layer.placesLow, ...layer.placesSize);
        attribute(3, layer.laid, 2, gl.UNSIGNED_SHORT, true, 4);
      } else {
        gl.disableVertexAttribArray(3);
      }
      if (layer.painted) {
        attribute(2, layer.painted, 3, gl.UNSIGNED_BYTE, true, 4);
      } else {
        gl.disableVertexAttribArray(2);
        gl.vertexAttrib3fv(2, layer.flat);
      }
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, shape.indices);
      gl.drawElements(gl.TRIANGLES, shape.triangles.length, gl.UNSIGNED_INT, 0);
    }
  }

  let waiting = false;
  function redraw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      draw();
    });
  }

  /** Look at all that is shown, from a side given in degrees. */
  function frame(turn, tilt) {
    const shown = layers.filter((one) => one.visible).map((one) => one.shape);
    const boxes = shown.length ? shown : geometries;
    const low = [0, 1, 2].map((k) => Math.min(...boxes.map((g) => g.low[k])));
    const high = [0, 1, 2].map((k) => Math.max(...boxes.map((g) => g.low[k] + g.size[k])));
    const half = low.map((value, k) => (high[k] - value) / 2);
    camera.target = low.map((value, k) => value + half[k]);
    camera.radius = Math.hypot(...half) || 1;
    const aspect = Math.max(canvas.clientWidth, 1) / Math.max(canvas.clientHeight, 1);
    const reach = Math.max(half[1], Math.hypot(half[0], half[2]) / aspect);
    camera.distance = (1.03 * reach) / Math.tan(FIELD / 2) + Math.hypot(half[0], half[2]);
    camera.turn = (turn * Math.PI) / 180;
    camera.tilt = (tilt * Math.PI) / 180;
    redraw();
  }

  // ---- hands -------------------------------------------------------------------------------------------------

  function orbit(dx, dy) {
    camera.turn -= 0.008 * dx;
    camera.tilt = Math.max(-1.55, Math.min(1.55, camera.tilt + 0.008 * dy));
    redraw();
  }

  function pan(dx, dy) {
    const metres = (2 * camera.distance * Math.tan(FIELD / 2)) / canvas.clientHeight;
    const [right, up] = axes();
    camera.target = camera.target.map((value, k) => value - metres * (dx * right[k] - dy * up[k]));
    redraw();
  }

  function zoom(factor) {
    camera.distance = Math.max(0.05 * camera.radius, Math.min(20 * camera.radius, camera.distance * factor));
    redraw();
  }

  const fingers = new Map();
  const apart = () => {
    const [a, b] = [...fingers.values()];
    return Math.hypot(a.x - b.x, a.y - b.y);
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  canvas.addEventListener("pointermove", (event) => {
    const last = fingers.get(event.pointerId);
    if (!last) return;
    const before = fingers.size === 2 ? apart() : 0;
    const [dx, dy] = [event.clientX - last.x, event.clientY - last.y];
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (fingers.size === 2) {
      pan(dx / 2, dy / 2);
      zoom(before / Math.max(apart(), 1));
    } else if (event.buttons & 6 || event.shiftKey) {
      pan(dx, dy);
    } else {
      orbit(dx, dy);
    }
  });
  for (const kind of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(kind, (event) => fingers.delete(event.pointerId));
  }
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas) return; // the page scrolls until the view is clicked
    event.preventDefault();
    zoom(Math.exp(0.0015 * event.deltaY));
  }, { passive: false });
  const KEYS = {
    ArrowLeft: () => orbit(-20, 0), ArrowRight: () => orbit(20, 0), ArrowUp: () => orbit(0, -20), ArrowDown: () => orbit(0, 20),
    "+": () => zoom(0.9), "-": () => zoom(1.1),
  };
  canvas.addEventListener("keydown", (event) => {
    if (!KEYS[event.key]) return;
    event.preventDefault();
    KEYS[event.key]();
  });
  canvas.addEventListener("webglcontextlost", () => say("The graphics driver has lost the view. Reload the page."));

  // ---- buttons and legend ------------------------------------------------------------------------------------

  function element(tag, text, into) {
    const made = document.createElement(tag);
    made.textContent = text;
    into.append(made);
    return made;
  }

  function button(text, into, act) {
    const made = element("button", text, into);
    made.type = "button";
    made.addEventListener("click", act);
    return made;
  }

  let group = layers[0].group;
  for (const layer of layers) {
    if (layer.group !== group) element("span", "", byId("layers")).className = "gap";
    group = layer.group;
    layer.button = button(layer.name, byId("layers"), () => {
      choose(layer, !layer.visible);
      refresh();
    });
  }

  /** Show or hide a layer. Of each group one is seen, and what moves is not seen beside what stands still. */
  function choose(layer, shown) {
    const moves = Boolean(layer.shape.motion);
    for (const other of layers) if (other.group === layer.group) other.visible = false;
    layer.visible = shown;
    if (!shown) return;
    for (const other of layers.filter((one) => one.visible && Boolean(one.shape.motion) !== moves)) {
      other.visible = false;
      const alike = layers.find((one) => one.group === other.group && Boolean(one.shape.motion) === moves);
      if (alike) alike.visible = true;
    }
  }

  function refresh() {
    for (const layer of layers) layer.button.setAttribute("aria-pressed", String(layer.visible));
    const explained = layers.find((layer) => layer.visible && layer.legend);
    const box = byId("legend");
    box.replaceChildren();
    box.hidden = !explained;
    if (explained) describe(explained.legend, box);
    redraw();
  }

  function describe(legend, box) {
    element("div", legend.unit ? `${legend.title} [${legend.unit}]` : legend.title, box);
    if (legend.names) {
      legend.names.forEach((name, k) => {
        const row = element("div", "", box);
        element("i", "", row).style.background = legend.colors[k];
        row.append(name);
      });
      return;
    }
    const ramp = element("div", "", box);
    ramp.className = "ramp";
    ramp.style.background = `linear-gradient(to right, ${legend.colors.join(", ")})`;
    const ticks = element("div", "", box);
    ticks.className = "ticks";
    for (const value of legend.values) element("span", value, ticks);
  }

  // ---- time --------------------------------------------------------------------------------------------------

  const moving = geometries.filter((one) => one.motion);
  if (moving.length && byId("time")) {
    const [slider, clock] = [byId("frame"), byId("clock")];
    const last = moving[0].motion.weights.length - 1;
    slider.max = last;
    let playedAt = null; // when it began, as if from frame 0 [ms]; null while it stands

    const seek = (frame) => {
      for (const geometry of moving) moveTo(geometry, frame);
      slider.value = frame;
      clock.textContent = `${(frame * scene.frameTime).toFixed(2)} s`;
      if (layers.some((one) => one.visible && one.shape.motion)) {
        redraw();
      } else {
        choose(layers.find((one) => one.shape.motion), true);
        refresh();
      }
    };
    const step = (now) => {
      if (playedAt === null) return;
      seek(((now - playedAt) / (1000 * scene.frameTime)) % (last + 1e-6));
      requestAnimationFrame(step);
    };
    const play = button("Play", byId("time"), () => {
      const stands = playedAt === null;
      play.textContent = stands ? "Pause" : "Play";
      playedAt = stands ? performance.now() - 1000 * scene.frameTime * slider.value : null;
      if (stands) requestAnimationFrame(step);
    });
    byId("time").prepend(play);
    slider.addEventListener("input", () => {
      playedAt = null;
      play.textContent = "Play";
      seek(Number(slider.value));
    });
    for (const geometry of moving) moveTo(geometry, 0);
    clock.textContent = "0.00 s";
    const asked = /^#t=(\d+(\.\d+)?)$/.exec(location.hash); // page.html#t=0.8 opens at that time
    if (asked) seek(Math.min(Number(asked[1]) / scene.frameTime, last));
  }

  const SIDES = { Reset: [20, 8], Front: [0, 0], Left: [90, 0], Back: [180, 0], Right: [270, 0] };
  for (const [name, side] of Object.entries(SIDES).reverse()) {
    byId("views").prepend(button(name, byId("views"), () => frame(...side)));
  }
  new ResizeObserver(redraw).observe(canvas);
  refresh();
  frame(...SIDES.Reset);
  draw();

  /** For scripts that move what is shown. */
  return {
    /** Places of each mesh, by number; the view goes along, by a way [m]. */
    place(meshes, way) {
      meshes.forEach((places, k) => place(geometries[k], places));
      camera.target = camera.target.map((value, k) => value + way[k]);
      redraw();
    },
    /** Show some layers, by number, their meshes at a mean of their frames: pairs of a frame and its share. */
    blend(numbers, shares) {
      layers.forEach((layer, k) => (layer.visible = numbers.includes(k)));
      for (const k of numbers) if (layers[k].shape.motion) blend(layers[k].shape, shares);
      refresh();
    },
  };
})();
