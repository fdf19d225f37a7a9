// Draws: points into a picture with depth, that picture shaded onto the canvas, lines over it.

const MOST_FRAME_MS = 45; // while something moves, fewer points are drawn rather than frames slower than this
const LEAST_POINTS = 30_000; // but never fewer than these
const FIRST_POINTS = 150_000; // in the first frames, before it is known how fast this machine is
const LEAST_SCALE = 0.45; // of the picture's width while something moves
const REST_MS = 250; // this long after the last movement all points are drawn
const PATH_COLOUR = [1, 1, 1, 0.9];
const MEASURE_COLOUR = [1, 1, 1, 1];

class Viewer {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: false, powerPreference: "high-performance" });
    this.renderer.autoClear = false;
    this.renderer.info.autoReset = false;
    this.scene = new THREE.Scene();
    this.overlay = new THREE.Scene();
    this.eye = new Eye(canvas, () => this.redraw());
    this.state = { picked: -1, hovered: -1, only: -1 };
    this.hiddenClasses = new Set(); // names
    this.scan = 0;
    this.isFinal = false;
    this.sizeFactor = 1;
    this.budget = FIRST_POINTS;
    this.scale = 1;
    this.makePasses();
    this.afterDrawing = []; // called after every frame
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
  }

  makePasses() {
    this.target = new THREE.WebGLRenderTarget(1, 1, {
      count: 2, minFilter: THREE.NearestFilter, magFilter: THREE.NearestFilter, depthBuffer: true,
      depthTexture: new THREE.DepthTexture(1, 1, THREE.UnsignedIntType),
    });
    const depth = { value: this.target.depthTexture };
    this.screen = new THREE.Vector2();
    this.pass = {
      picture: { value: this.target.textures[0] }, depth, near: { value: 0.1 }, far: { value: 1000 },
      height: { value: 1 }, reach: { value: 1 }, rim: { value: 2 }, isMarking: { value: false },
    };
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: SCREEN_VERTEX, fragmentShader: SCREEN_FRAGMENT,
      uniforms: this.pass, depthTest: false, depthWrite: false,
    });
    this.quad = new THREE.Scene();
    const plane = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), material);
    plane.frustumCulled = false;
    this.quad.add(plane);

    const shared = { depth, screen: { value: this.screen } };
    this.lines = {
      path: new Lines(2.5, 0.25, shared), robot: new Lines(2, 0.35, shared), boxes: new Lines(1.5, 0.15, shared),
      picked: new Lines(2, 0.35, shared), measure: new Lines(2.5, 0.6, shared),
    };
    for (const { mesh } of Object.values(this.lines)) this.overlay.add(mesh);
  }

  /** Show a map, the first or one that has grown. */
  setMap(facts, columns) {
    const former = this.cloud;
    const view = former && { origin: this.facts.origin, picked: this.idOf(this.state.picked), only: this.idOf(this.state.only) };
    if (former) {
      this.scene.remove(former.points);
      former.dispose();
    }
    Object.assign(this, { facts, columns });
    this.labels = new Labels(facts, columns);
    this.cloud = new Cloud(facts, columns, this.labels);
    this.scene.add(this.cloud.points);
    this.findFirstSeen();
    this.eye.setReach(Math.hypot(...[0, 1, 2].map((axis) => 2 * Math.abs(facts.low[axis]))));
    if (view) {
      this.eye.shift([0, 1, 2].map((axis) => view.origin[axis] - facts.origin[axis]));
      Object.assign(this.state, { picked: this.placeOf(view.picked), only: this.placeOf(view.only), hovered: -1 });
    }
    this.showPath(this.isPathShown ?? true);
    this.colourBy(this.how ?? facts.colour);
    this.showClasses();
    if (this.cut !== undefined) this.cutAt(this.cut);
  }

  idOf(place) {
    return place >= 0 ? this.columns.object_ids[place] : undefined;
  }

  placeOf(id) {
    return id === undefined ? -1 : this.columns.object_ids.indexOf(id);
  }

  /** For every object of now the first scan that saw some of it. */
  findFirstSeen() {
    const { object, object_ids } = this.columns;
    this.firstSeen = new Uint32Array(object_ids.length).fill(0xffffffff);
    for (let row = this.facts.num_points - 1; row >= 0; row--) this.firstSeen[object[row]] = row;
    for (let k = 0; k < object_ids.length; k++) this.firstSeen[k] = this.cloud.scanOf(this.firstSeen[k]);
  }

  colourBy(how) {
    this.how = how;
    this.cloud.colourBy(how);
    this.redraw();
  }

  /** Show the map as it was after that many scans, with the labels of then or of now. */
  showScan(scan, isFinal) {
    Object.assign(this, { scan, isFinal });
    this.cloud.showScan(scan, isFinal);
    this.mark({});
    const { path, floors } = this.columns;
    const place = path.subarray(3 * (scan - 1), 3 * scan);
    this.lines.path.limit(scan - 1);
    this.lines.robot.set(this.isPathShown ? scannerMark(place, floors[scan - 1], PATH_COLOUR) : []);
    this.drawBoxes();
  }

  showPath(isShown) {
    this.isPathShown = isShown;
    const { path } = this.columns;
    const at = (k) => path.subarray(3 * k, 3 * k + 3);
    const stretches = Array.from({ length: this.facts.num_scans - 1 }, (_, k) => [at(k), at(k + 1), PATH_COLOUR]);
    this.lines.path.set(isShown ? stretches : []);
    if (this.scan) this.showScan(Math.min(this.scan, this.facts.num_scans), this.isFinal);
  }

  showBoxes(areShown) {
    this.areBoxesShown = areShown;
    this.drawBoxes();
  }

  /** Boxes around the objects of now that have been seen by the moment shown, and around the picked one. */
  drawBoxes() {
    const { object_sizes, object_boxes, object_classes, class_colours } = this.columns;
    const stretches = [];
    for (let k = 1; this.areBoxesShown && k < object_sizes.length; k++) {
      const isShown = object_sizes[k] && this.firstSeen[k] < this.scan && !this.hiddenClasses.has(this.nameOf(object_classes[k]));
      if (!isShown || (this.state.only >= 0 && k !== this.state.only)) continue;
      const box = this.belowCut(object_boxes.subarray(7 * k, 7 * k + 7));
      const tint = [...class_colours.subarray(3 * object_classes[k], 3 * object_classes[k] + 3)].map((c) => c / 255);
      if (box) stretches.push(...boxEdges(box, [...tint, 1]));
    }
    this.lines.boxes.set(stretches);
    const { picked } = this.state;
    const hasBox = picked > 0 && object_sizes[picked] > 0;
    this.lines.picked.set(hasBox ? boxEdges(object_boxes.subarray(7 * picked, 7 * picked + 7), [1, 1, 1, 0.8]) : []);
    this.redraw();
  }

  /** What of a box lies below the height that is shown, if anything. */
  belowCut([x, y, z, length, width, height, yaw]) {
    const cut = this.columns.floors[Math.max(this.scan - 1, 0)] + this.cloud.cut;
    const [bottom, top] = [z - height / 2, Math.min(z + height / 2, cut)];
    return bottom < cut ? [x, y, (bottom + top) / 2, length, width, top - bottom, yaw] : undefined;
  }

  nameOf(semantic) {
    return this.facts.classes.find((entry) => entry.semantic === semantic)?.name ?? "unknown";
  }

  /** Mark objects, see `Cloud.markObjects`; what is not named stays. */
  mark(changes) {
    Object.assign(this.state, changes);
    this.cloud.markObjects(this.state);
    if ("picked" in changes || "only" in changes) this.drawBoxes();
    this.redraw();
  }

  showClasses() {
    this.cloud.showClasses((entry) => !this.hiddenClasses.has(entry.name));
    this.drawBoxes();
  }

  cutAt(height) {
    this.cut = height;
    this.cloud.cutAt(height);
    this.drawBoxes();
  }

  setSize(factor) {
    this.sizeFactor = factor;
    this.redraw();
  }

  /** Follow the window: its size, its pixels, and what of it the panels leave free. */
  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.eye.resize(width, height, freePart(width, height));
    this.redraw();
  }

  /** Draw again: while things move as many points as a smooth picture allows, at rest all of them. */
  redraw() {
    this.isStale = true;
    this.changed = performance.now();
    if (!this.isDrawing && this.cloud) this.drawUntilRest();
  }

  async drawUntilRest() {
    this.isDrawing = true;
    document.body.dataset.rest = "";
    while (this.isStale) {
      while (this.isStale || this.isHeld || performance.now() - this.changed < REST_MS) {
        await new Promise(requestAnimationFrame);
        if (!this.isStale) continue;
        this.isStale = false;
        this.learn(await this.draw(this.budget, this.scale));
      }
      await this.draw(Infinity, 1);
    }
    this.isDrawing = false;
    document.body.dataset.rest = "yes";
  }

  /** Draw, see `paint`; returns the milliseconds until it was done. */
  async draw(most, scale) {
    const started = performance.now();
    this.paint(most, scale);
    await this.idsAt(0, 0, 1); // waits for the graphics card
    this.frames = (this.frames ?? 0) + 1;
    document.body.dataset.frames = this.frames;
    return performance.now() - started;
  }

  /** Draw at most so many points into a picture of that share of the window. */
  paint(most, scale) {
    const { renderer, target, cloud, eye, screen, pass } = this;
    this.setScale(scale);
    eye.update();

    // fewer points are drawn larger, but surfaces need not close while they move
    const drawn = Math.min(cloud.total, most);
    cloud.geometry.setDrawRange(0, drawn);
    const growth = Math.min(Math.sqrt(cloud.total / drawn), 2);
    cloud.uniforms.radius.value = SURFEL * this.facts.voxel_size * this.sizeFactor * growth;
    cloud.uniforms.height.value = pass.height.value = screen.y;
    [pass.near.value, pass.far.value] = [eye.camera.near, eye.camera.far];
    const pixel = renderer.getPixelRatio();
    [pass.reach.value, pass.rim.value] = [Math.max(1, Math.round(1.3 * pixel)), Math.max(1, Math.round(1.6 * pixel))];
    pass.isMarking.value = this.state.picked > 0 || this.state.hovered > 0;
    for (const { uniforms, width } of Object.values(this.lines)) uniforms.width.value = width * pixel;

    renderer.setClearColor(0x000000, 0);
    renderer.setRenderTarget(target);
    renderer.clear();
    renderer.render(this.scene, eye.camera);
    renderer.setRenderTarget(null);
    renderer.render(this.quad, eye.camera);
    renderer.render(this.overlay, eye.camera);
    for (const after of this.afterDrawing) after();
  }

  /** Draw that share of the window's pixels along each side; the browser makes them larger. */
  setScale(scale) {
    const ratio = Math.min(window.devicePixelRatio || 1, 3) * scale;
    if (Math.abs(ratio - this.renderer.getPixelRatio()) > 0.01) this.renderer.setPixelRatio(ratio);
    const { x, y } = this.renderer.getDrawingBufferSize(this.screen);
    if (this.target.width !== x || this.target.height !== y) this.target.setSize(x, y);
  }

  /** Learn from the milliseconds that a frame took how much the next one may draw. */
  learn(ms) {
    const { total } = this.cloud;
    const drawn = Math.min(this.budget, total);
    if (ms > MOST_FRAME_MS) {
      const share = Math.max(MOST_FRAME_MS / ms, 0.3);
      if (drawn > 3 * LEAST_POINTS) this.budget = Math.max(share * drawn, LEAST_POINTS);
      else if (this.scale > LEAST_SCALE) this.scale = Math.max(LEAST_SCALE, this.scale * Math.max(share, 0.7));
      else this.budget = Math.max(share * drawn, LEAST_POINTS);
    } else if (ms < 0.6 * MOST_FRAME_MS) {
      if (this.scale < 1) this.scale = Math.min(1, this.scale * 1.15);
      else if (this.budget < total) this.budget *= 1.3;
    }
  }

  /** Numbers of the points around a pixel of the window, as a square of that width. */
  async idsAt(x, y, width) {
    const share = this.target.width / this.canvas.parentElement.clientWidth;
    const bytes = new Uint8Array(4 * width * width);
    const [left, top] = [Math.round(x * share) - (width >> 1), Math.round(y * share) - (width >> 1)];
    const bottom = this.target.height - top - width;
    const isInside = left >= 0 && bottom >= 0 && left + width <= this.target.width && bottom + width <= this.target.height;
    if (isInside) {
      await this.renderer.readRenderTargetPixelsAsync(this.target, left, bottom, width, width, bytes, undefined, 1);
    }
    return new Uint32Array(bytes.buffer);
  }

  /** Show all that is to be seen, along a direction (radians), or along the best one. */
  fit(yaw, pitch, isSudden) {
    const points = this.cloud.sample(SAMPLE).map((row) => this.cloud.positionOf(row));
    if (!points.length) return;

    // whatever stray points there are
    const order = [0, 1, 2].map((axis) => points.map((point) => point[axis]).sort((a, b) => a - b));
    const [low, high] = [0.005, 0.995].map((share) => order.map((values) => values[Math.floor(share * (values.length - 1))]));
    const kept = points.filter((point) => point.every((value, axis) => value >= low[axis] && value <= high[axis]));
    this.eye.fit(kept.length ? kept : points, yaw, pitch, isSudden);
  }
}

/** The part of the window that panels leave free. */
function freePart(width, height) {
  const isNarrow = width < 700;
  const margin = 12;
  const panel = element("panel").getBoundingClientRect();
  const time = element("time").getBoundingClientRect();
  const picked = element("picked").getBoundingClientRect();
  const bottom = (isNarrow && picked.height ? picked : time).top - margin;
  if (isNarrow) {
    const top = (document.body.dataset.folded ? panel.bottom : 0) + margin / 2;
    return { x: margin, y: top, width: width - 2 * margin, height: Math.max(bottom - top, 80) };
  }
  const left = (document.body.dataset.folded ? 0 : panel.right) + margin;
  return { x: left, y: margin, width: Math.max(width - left - margin, 80), height: Math.max(bottom - margin, 80) };
}
