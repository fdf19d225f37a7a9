// Draws: points into a picture with depth, that picture shaded onto the canvas, lines over it.

const MOST_FRAME_MS = 45; // while something moves, fewer points are drawn rather than frames slower than this
const LEAST_POINTS = 30_000; // but never fewer than these
const FIRST_POINTS = 150_000; // in the first frames, before it is known how fast this machine is
const LEAST_SCALE = 0.45; // of the picture's width while something moves
const NARROW = 700; // pixels of the window below which panels cover it, as in page.css
const REST_MS = 250; // this long after the last movement all points are drawn

class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: false, powerPreference: "high-performance" });
    this.renderer.autoClear = false;
    this.scene = new THREE.Scene();
    this.overlay = new THREE.Scene();
    this.eye = new Eye(canvas, () => this.redraw());
    this.sizeFactor = 1;
    this.budget = FIRST_POINTS;
    this.scale = 1;
    this.afterDrawing = []; // called after every frame
    this.makePasses();
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
      await this.drawAll();
    }
    this.isDrawing = false;
    document.body.dataset.rest = "yes";
  }

  /** Draw, see `paint`; returns the milliseconds until it was done. */
  async draw(most, scale) {
    const started = performance.now();
    this.paint(most, scale);
    await this.finished(started);
    return performance.now() - started;
  }

  /** Draw all points, some at a time, so that whatever is asked for in between need not wait for long. */
  async drawAll() {
    const started = performance.now();
    const some = Math.max(this.budget, LEAST_POINTS);
    this.begin(1);
    const { chosen } = this.cloud.choose(this.eye, this.target.height, Infinity);
    for (let start = 0; start < chosen; start += some) {
      this.addPoints(start, Math.min(some, chosen - start), 1);
      await this.idsAt(0, 0, 1);
      if (this.isStale) return;
    }
    this.show();
    await this.finished(started);
  }

  /** Wait for the graphics card, and note when the picture that is done now was begun. */
  async finished(started) {
    await this.idsAt(0, 0, 1);
    document.body.dataset.begun = started;
  }

  /** Draw at most so many points into a picture of that share of the window's pixels along each side. */
  paint(most, scale) {
    this.begin(scale);
    // fewer points are drawn larger, but surfaces need not close while they move
    const { chosen, growth } = this.cloud.choose(this.eye, this.target.height, most);
    this.addPoints(0, chosen, growth);
    this.show();
  }

  /** Begin a picture; what the canvas shows stays until the picture is done. */
  begin(scale) {
    const { renderer, target, pass, eye } = this;
    this.ratio = Math.min(window.devicePixelRatio || 1, 3) * scale;
    const { width, height } = eye.window;
    const [columns, rows] = [Math.floor(width * this.ratio), Math.floor(height * this.ratio)];
    if (target.width !== columns || target.height !== rows) target.setSize(columns, rows);
    eye.update();
    [pass.near.value, pass.far.value] = [eye.camera.near, eye.camera.far];
    renderer.setClearColor(0x000000, 0);
    renderer.setRenderTarget(target);
    renderer.clear();
  }

  addPoints(start, number, growth) {
    const { uniforms } = this.cloud;
    this.cloud.limit(start, number);
    uniforms.radius.value = SURFEL * this.facts.voxel_size * this.sizeFactor * growth;
    uniforms.height.value = this.target.height;
    this.renderer.setRenderTarget(this.target);
    this.renderer.render(this.scene, this.eye.camera);
  }

  /** Put the picture on the canvas, shaded, and lines over it. */
  show() {
    const { renderer, pass, eye, ratio } = this;
    renderer.setRenderTarget(null);
    if (Math.abs(ratio - renderer.getPixelRatio()) > 1e-3) renderer.setPixelRatio(ratio);
    renderer.getDrawingBufferSize(this.screen);
    pass.height.value = this.screen.y;
    [pass.reach.value, pass.rim.value] = [1.3, 1.6].map((pixels) => Math.max(1, Math.round(pixels * ratio)));
    pass.isMarking.value = this.state.picked > 0 || this.state.hovered > 0;
    for (const { uniforms, width } of Object.values(this.lines)) uniforms.width.value = width * ratio;
    renderer.render(this.quad, eye.camera);
    renderer.render(this.overlay, eye.camera);
    for (const after of this.afterDrawing) after();
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
}

/** The part of the window that panels leave free. */
function freePart(width, height) {
  const isNarrow = width < NARROW;
  const margin = 12;
  const panel = element("panel").getBoundingClientRect();
  const time = element("time").getBoundingClientRect();
  const picked = element("picked").getBoundingClientRect();
  const bottom = (isNarrow && picked.height ? picked.top : time.height ? time.top : height) - margin;
  if (isNarrow) {
    const top = (document.body.dataset.folded ? panel.bottom : 0) + margin / 2;
    return { x: margin, y: top, width: width - 2 * margin, height: Math.max(bottom - top, 80) };
  }
  const left = (document.body.dataset.folded ? 0 : panel.right) + margin;
  return { x: left, y: margin, width: Math.max(width - left - margin, 80), height: Math.max(bottom - margin, 80) };
}
