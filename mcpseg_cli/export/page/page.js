// The map of a run of `mcpseg segment` on a page: K3D-jupyter (three.js) draws, this file switches.
// Points come in the order they were first seen in, so that the map after a scan is a beginning of the list.
"use strict";

const MOST_FRAME_MS = 50; // while something moves, fewer points are drawn rather than frames slower than this
const LEAST_POINTS = 20_000; // but never fewer than these
const REST_MS = 250; // this long after the last movement all points are drawn
const PHASES = 16; // any beginning of the drawn list is a sparse sample of the map
const PICK_PIXELS = 7;
const PLAY_S = 20; // a whole run plays in this time, a short one faster
const LEAST_SCANS_PER_S = 5;
const [POINTS, PATH, ROBOT, MARK] = [1, 2, 3, 4]; // ids of what is drawn

const element = (id) => document.getElementById(id);
const count = (number) => number.toLocaleString("en");

/** Undo base64 and zlib: the Uint8Array that a script element of the page holds. */
async function unpack(id) {
  const text = atob(element(id).textContent);
  element(id).remove();
  const packed = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Run K3D's bundle, an AMD module, and return what it exports. */
async function loadLibrary() {
  const url = URL.createObjectURL(new Blob([await unpack("library")], { type: "text/javascript" }));
  return new Promise((resolve, reject) => {
    window.define = (name, needs, make) => resolve(make());
    window.define.amd = {};
    const script = document.createElement("script");
    script.onload = () => URL.revokeObjectURL(url);
    script.onerror = () => reject(new Error("the drawing library cannot be run"));
    script.src = url;
    document.head.append(script);
  });
}

/** The columns of the map by name, typed arrays over one buffer. */
async function loadColumns(facts) {
  const { buffer } = await unpack("cloud");
  const types = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, i4: Int32Array, f4: Float32Array };
  const columns = {};
  for (const { name, type, offset, length } of facts.columns) columns[name] = new types[type](buffer, offset, length);
  return columns;
}

/** Positions in metres from the middle of the map, (3 N) float32. */
function positions(facts, { xyz }) {
  const total = facts.num_points;
  const metres = new Float32Array(3 * total);
  for (let axis = 0; axis < 3; axis++) {
    for (let i = 0; i < total; i++) metres[3 * i + axis] = facts.low[axis] + facts.step * xyz[axis * total + i];
  }
  return metres;
}

class Viewer {
  constructor(library, facts, columns) {
    this.facts = facts;
    this.columns = columns;
    this.isShown = facts.classes.map((entry) => entry.shown);
    this.scan = facts.num_scans; // scans done at the moment shown
    this.budget = Infinity; // points drawn while something moves
    this.plot = new library.K3D(library.ThreeJsProvider, element("scene"), {
      menuVisibility: false, cameraMode: "orbit", cameraUpAxis: "z", cameraAutoFit: false, gridVisible: false,
      axesHelper: 0, logarithmicDepthBuffer: false, antialias: 1, clearColor: 0x39414c, minimumFps: -1,
    });
  }

  /** Hand the points, the path and two markers to K3D and keep hold of what three.js made of them. */
  async load() {
    this.xyz = positions(this.facts, this.columns);
    const { path } = this.columns;
    const at = (points) => ({ data: points, shape: [points.length / 3, 3], dtype: "float32" });
    const matrix = { data: Float32Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1), shape: [4, 4] };
    const ball = { type: "Points", visible: true, opacity: 1, model_matrix: matrix, colors: { data: [], shape: [0] } };
    const size = this.facts.point_size;
    const objects = [
      { ...ball, id: POINTS, shader: "flat", positions: at(this.xyz), point_size: size, color: 0xffffff },
      { ...ball, id: ROBOT, shader: "3d", positions: at(path.slice(0, 3)), point_size: 3.5 * size, color: 0xff7a1a },
      { ...ball, id: MARK, shader: "3d", positions: at(path.slice(0, 3)), point_size: 3 * size, color: 0xff2fd0 },
    ];
    if (this.facts.num_scans > 1) {
      objects.push({ id: PATH, type: "Line", shader: "thick", visible: true, opacity: 1, width: 0.35 * size,
        vertices: at(path), color: 0xff7a1a, colors: { data: [], shape: [0] }, model_matrix: matrix });
    }
    await this.plot.load({ objects });
    [this.points, this.robot, this.mark] = [POINTS, ROBOT, MARK].map((id) => this.plot.getObjectById(id));
    this.line = this.plot.getObjectById(PATH);
    this.mark.visible = false;
    for (const object of [this.robot, this.mark]) object.frustumCulled = false; // they move
    const { geometry } = this.points;
    this.drawn = new Uint32Array(this.facts.num_points);
    geometry.setIndex(new geometry.attributes.position.constructor(this.drawn, 1));
  }

  /** Colour every point: `how` is rgb, class, instance, confidence or embedding. */
  colourBy(how) {
    const { color } = this.points.geometry.attributes;
    const [key, palette] = {
      rgb: [null, this.columns.rgb], embedding: [null, this.columns.embedding],
      class: [this.columns.semantic, this.columns.class_colours],
      instance: [this.columns.object, this.columns.object_colours],
      confidence: [this.columns.confidence, this.columns.confidence_colours],
    }[how];
    for (let i = 0; i < this.facts.num_points; i++) {
      const from = 3 * (key ? key[i] : i);
      for (let channel = 0; channel < 3; channel++) color.array[3 * i + channel] = palette[from + channel] / 255;
    }
    color.needsUpdate = true;
    this.redraw();
  }

  /** List the points of the moment and of the classes shown, in an order that can be cut short anywhere. */
  select() {
    const { semantic, scan_ends } = this.columns;
    const shown = new Uint8Array(256);
    this.facts.classes.forEach((entry, place) => { shown[entry.semantic] = this.isShown[place]; });
    const end = scan_ends[this.scan - 1];
    let total = 0;
    for (let phase = 0; phase < PHASES; phase++) {
      for (let i = (phase * 7) % PHASES; i < end; i += PHASES) if (shown[semantic[i]]) this.drawn[total++] = i;
    }
    this.numDrawn = total;
    this.points.geometry.index.needsUpdate = true;
    this.redraw();
  }

  /** Show the map as it was after that many scans. */
  showScan(scan) {
    this.scan = scan;
    const place = this.columns.path.subarray(3 * (scan - 1), 3 * scan);
    this.moveTo(this.robot, place);
    if (this.line) {
      const { geometry } = this.line;
      const each = geometry.index.count / (this.facts.num_scans - 1); // indices of one stretch
      geometry.setDrawRange(0, each * (scan - 1));
    }
    this.select();
  }

  showPath(isShown) {
    for (const object of [this.robot, this.line]) if (object) object.visible = isShown;
    this.redraw();
  }

  moveTo(object, place) {
    const { position } = object.geometry.attributes;
    position.array.set(place);
    position.needsUpdate = true;
  }

  setSize(factor) {
    this.points.material.size = factor * this.facts.point_size;
    this.redraw();
  }

  /** Draw again: while things move as many points as a smooth picture allows, at rest all of them. */
  redraw() {
    this.isStale = true;
    this.changed = performance.now();
    if (!this.isDrawing) this.drawUntilRest();
  }

  async drawUntilRest() {
    this.isDrawing = true;
    while (this.isStale) {
      while (this.isStale || this.isHeld || performance.now() - this.changed < REST_MS) {
        await new Promise(requestAnimationFrame);
        if (!this.isStale) continue;
        this.isStale = false;
        this.learn(await this.draw(this.budget));
      }
      await this.draw(Infinity);
    }
    this.isDrawing = false;
  }

  /** Draw at most so many points; returns the milliseconds until they were on the screen. */
  async draw(most) {
    const started = performance.now();
    this.points.geometry.setDrawRange(0, Math.min(this.numDrawn ?? 0, most));
    await this.plot.render();
    const gl = this.plot.getWorld().renderer.getContext();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); // waits for the graphics card
    return performance.now() - started;
  }

  /** Learn from the milliseconds that a frame of a movement took how many points the next ones may have. */
  learn(ms) {
    const share = Math.min(Math.max(MOST_FRAME_MS / ms, 0.1), 1.25);
    if (share < 1) this.budget = Math.max(share * Math.min(this.numDrawn, this.budget), LEAST_POINTS);
    else if (this.budget < this.numDrawn) this.budget *= share;
  }

  /** Look at the whole map from a direction. */
  lookFrom(direction) {
    const { radius, middle } = this.facts;
    const length = Math.hypot(...direction);
    const distance = 1.9 * radius;
    const eye = direction.map((part, axis) => middle[axis] + (distance * part) / length);
    this.plot.setCamera([...eye, ...middle, 0, 0, 1]);
    this.redraw();
  }

  /** The nearest drawn point under a pixel of the scene, or -1. */
  pick(x, y) {
    const { camera, width, height } = this.plot.getWorld();
    camera.updateMatrixWorld();
    const m = camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse).elements;
    const pixels = (camera.projectionMatrix.elements[5] * height) / 2; // of a metre at a metre's distance
    let [best, bestDepth] = [-1, Infinity];
    for (let k = 0; k < this.numDrawn; k++) {
      const i = 3 * this.drawn[k];
      const [px, py, pz] = [this.xyz[i], this.xyz[i + 1], this.xyz[i + 2]];
      const depth = m[3] * px + m[7] * py + m[11] * pz + m[15];
      if (depth <= 0 || depth >= bestDepth) continue;
      const dx = ((m[0] * px + m[4] * py + m[8] * pz + m[12]) / depth + 1) * 0.5 * width - x;
      const dy = (1 - (m[1] * px + m[5] * py + m[9] * pz + m[13]) / depth) * 0.5 * height - y;
      const reach = Math.max(PICK_PIXELS / 2, (0.5 * pixels * this.points.material.size) / depth);
      if (dx * dx + dy * dy < reach * reach) [best, bestDepth] = [this.drawn[k], depth];
    }
    return best;
  }

  /** Put the marker on a point, or take it away. */
  markPoint(point) {
    this.mark.visible = point >= 0;
    if (point >= 0) this.moveTo(this.mark, this.xyz.subarray(3 * point, 3 * point + 3));
    this.redraw();
  }
}

/** What is known of a point, as pairs of name and text. */
function describe({ facts, columns, xyz }, point) {
  const { semantic, object, object_ids, object_sizes, confidence, scan_ends } = columns;
  const name = facts.classes.find((entry) => entry.semantic === semantic[point]).name;
  const place = [0, 1, 2].map((axis) => (xyz[3 * point + axis] + facts.origin[axis]).toFixed(2));
  return [
    ["class", name],
    ["object", `${object_ids[object[point]]} (${count(object_sizes[object[point]])} points)`],
    ["confidence", (confidence[point] / 255).toFixed(2)],
    ["first seen", `scan ${count(scan_ends.findIndex((end) => point < end) + 1)}`],
    ["x y z", `${place.join("  ")} m`],
  ];
}

function showPicked(viewer, point) {
  element("picked").hidden = point < 0;
  viewer.markPoint(point);
  if (point < 0) return;
  const entries = describe(viewer, point).flatMap((pair) => pair.map((text, place) => {
    const entry = document.createElement(place ? "dd" : "dt");
    entry.textContent = text;
    return entry;
  }));
  element("picked").querySelector("dl").replaceChildren(...entries);
}

function makeColourButtons(viewer, names, chosen) {
  const choose = (button) => {
    for (const other of element("colours").children) other.setAttribute("aria-checked", other === button);
    element("scale").hidden = button.value !== "confidence";
    viewer.colourBy(button.value);
  };
  for (const name of names) {
    const button = document.createElement("button");
    Object.assign(button, { type: "button", value: name, textContent: name });
    button.setAttribute("role", "radio");
    button.onclick = () => choose(button);
    element("colours").append(button);
    if (name === chosen) choose(button);
  }
  const { confidence_colours: ramp } = viewer.columns;
  const stops = [0, 64, 128, 192, 255].map((step) => `rgb(${ramp.slice(3 * step, 3 * step + 3).join()})`);
  element("scale").querySelector("i").style.background = `linear-gradient(90deg, ${stops.join()})`;
}

function makeLegend(viewer) {
  const boxes = viewer.facts.classes.map((entry, place) => {
    const row = document.createElement("label");
    const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: entry.shown });
    const [swatch, name, points] = ["swatch", "name", "count"].map((kind) =>
      Object.assign(document.createElement("span"), { className: kind }));
    const colour = viewer.columns.class_colours.slice(3 * entry.semantic, 3 * entry.semantic + 3);
    swatch.style.background = `rgb(${colour.join()})`;
    [name.textContent, points.textContent] = [entry.name, count(entry.num_points)];
    box.onchange = () => { viewer.isShown[place] = box.checked; viewer.select(); };
    row.append(box, swatch, name, points);
    element("legend").append(document.createElement("li"));
    element("legend").lastChild.append(row);
    return box;
  });
  const setAll = (checked) => {
    for (const box of boxes) box.checked = checked;
    viewer.isShown.fill(checked);
    viewer.select();
  };
  element("all").onclick = () => setAll(true);
  element("none").onclick = () => setAll(false);
}

function makeTimeline(viewer) {
  const [slider, play] = [element("scan"), element("play")];
  const last = viewer.facts.num_scans;
  const rate = Math.max(last / PLAY_S, LEAST_SCANS_PER_S);
  let started; // when and where playing began
  const show = () => {
    viewer.showScan(Number(slider.value));
    const seen = viewer.columns.scan_ends[slider.value - 1];
    element("moment").textContent = `scan ${count(Number(slider.value))} of ${count(last)}, ${count(seen)} points`;
  };
  const stop = () => { started = undefined; play.textContent = "▶"; };
  const step = (now) => {
    if (started === undefined) return;
    const due = started.scan + Math.floor(((now - started.ms) / 1000) * rate);
    if (due !== Number(slider.value)) { slider.value = Math.min(due, last); show(); }
    if (due >= last) stop();
    else requestAnimationFrame(step);
  };
  play.onclick = () => {
    if (started !== undefined) { stop(); return; }
    if (Number(slider.value) === last) slider.value = 1;
    started = { ms: performance.now(), scan: Number(slider.value) };
    play.textContent = "❚❚";
    requestAnimationFrame(step);
  };
  slider.max = last;
  slider.value = last;
  slider.oninput = () => { stop(); show(); };
  show();
}

function listenToScene(viewer) {
  const scene = element("scene");
  let pressed;
  scene.addEventListener("pointerdown", (event) => {
    pressed = [event.clientX, event.clientY];
    viewer.isHeld = true;
  }, true);
  window.addEventListener("pointerup", () => { viewer.isHeld = false; }, true);
  scene.addEventListener("pointerup", (event) => {
    const moved = pressed ? Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) : Infinity;
    pressed = undefined;
    if (moved < 4 && event.button === 0) showPicked(viewer, viewer.pick(event.clientX, event.clientY));
  }, true);
  viewer.plot.on(viewer.plot.events.CAMERA_CHANGE, () => viewer.redraw());
  element("unpick").onclick = () => showPicked(viewer, -1);
  element("top").onclick = () => viewer.lookFrom([0, -0.001, 1]);
  element("aslant").onclick = () => viewer.lookFrom([-0.55, -0.75, 0.8]);
  element("size").oninput = (event) => viewer.setSize(Number(event.target.value));
  element("path").onchange = (event) => viewer.showPath(event.target.checked);
}

async function main() {
  const facts = JSON.parse(element("facts").textContent);
  const [library, columns] = await Promise.all([loadLibrary(), loadColumns(facts)]);
  const viewer = new Viewer(library, facts, columns);
  await viewer.load();
  const numbers = [[facts.num_points, "points"], [columns.object_ids.length, "objects"], [facts.num_scans, "scans"]];
  element("summary").textContent = numbers.map(([number, what]) => `${count(number)} ${what}`).join(" · ");
  makeLegend(viewer);
  makeTimeline(viewer);
  makeColourButtons(viewer, facts.colours, facts.colour);
  listenToScene(viewer);
  viewer.lookFrom([-0.55, -0.75, 0.8]);
  element("message").textContent = "";
  document.body.dataset.state = "ready";
}

main().catch((error) => {
  element("message").textContent = `This page cannot be shown: ${error.message ?? error}`;
  document.body.dataset.state = "failed";
});
