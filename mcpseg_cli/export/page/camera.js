// Where the eye is: turning and moving by hand, the whole map in what is free of the window, flights.

const FLIGHT_MS = 450;
const LEAST_RISE = 1.7; // metres up for each across, where a flight ends
const NEAREST_FLIGHT = 3; // metres
const YAWS = 36; // directions tried for the first look, around
const PITCHES = [45, 52, 60, 66]; // degrees, and down
const SAMPLE = 3000; // points that stand for the map where it is fitted

class Eye {
  constructor(canvas, changed) {
    this.changed = changed;
    this.camera = new THREE.PerspectiveCamera(40, 1, 0.1, 1000);
    this.camera.up.set(0, 0, 1);
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    Object.assign(this.controls, { screenSpacePanning: true, zoomToCursor: true, minDistance: 0.3 });
    this.controls.touches = { ONE: THREE.TOUCH.ROTATE, TWO: THREE.TOUCH.DOLLY_PAN };
    this.controls.addEventListener("change", changed);
    this.controls.addEventListener("start", () => { this.flight = undefined; });
    this.free = { x: 0, y: 0, width: 1, height: 1 };
  }

  /** Put what is looked at into the middle of the free part of the window. */
  resize(width, height, free) {
    this.free = free;
    this.camera.aspect = width / height;
    const shift = (middle, all) => Math.round(all / 2 - middle);
    this.camera.setViewOffset(
      width, height, shift(free.x + free.width / 2, width), shift(free.y + free.height / 2, height), width, height);
    this.window = { width, height };
  }

  /** Near and far planes around a map of this extent. */
  setReach(reach) {
    this.reach = reach;
    this.controls.maxDistance = 8 * reach;
    this.update();
  }

  update() {
    const away = this.camera.position.distanceTo(this.controls.target);
    this.camera.far = away + 4 * this.reach;
    this.camera.near = Math.max(0.05, Math.min(0.2, away / 50));
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
  }

  /** Axes of a view: right, up, and from what is looked at to the eye. */
  static axes(yaw, pitch) {
    const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    return { right: [cy, sy, 0], up: [-sy * sp, cy * sp, cp], back: [sy * cp, -cy * cp, sp] };
  }

  /** Look at all of these points ([x, y, z] each) along a direction, or along the one that shows them largest. */
  fit(points, yaw, pitch, isSudden) {
    if (!points.length) return;
    const choices = yaw === undefined
      ? PITCHES.flatMap((degrees) => Array.from({ length: YAWS }, (_, k) => [(k * 2 * Math.PI) / YAWS, (degrees * Math.PI) / 180]))
      : [[yaw, pitch]];
    let best;
    for (const [turn, slope] of choices) {
      const look = this.fitAlong(points, Eye.axes(turn, slope));
      if (!best || look.covered > best.covered) best = look;
    }
    this.lookAt(best.target, best.position, isSudden);
  }

  /** The place from which points just fit into the free part, and how much of it they cover. */
  fitAlong(points, { right, up, back }) {
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const local = points.map((point) => [dot(point, right), dot(point, up), dot(point, back)]);
    const half = Math.tan((this.camera.fov * Math.PI) / 360);
    const slope = [(half * this.free.width) / this.window.height, (half * this.free.height) / this.window.height].map((x) => 0.95 * x);

    // for each side of the picture the plane through it that touches the points
    const touch = [0, 1].map((axis) => [1, -1].map((sign) => Math.max(...local.map((p) => sign * p[axis] + slope[axis] * p[2]))));
    const middle = touch.map(([high, low]) => (high - low) / 2);
    const away = Math.max(...touch.map(([high, low], axis) => (high + low) / 2 / slope[axis]));
    const inner = local.reduce((sum, p) => sum + p[2], 0) / local.length;

    // how many cells of the free part have a point in them
    const cells = new Set();
    for (const [u, v, w] of local) {
      const place = [(u - middle[0]) / (away - w) / slope[0], (v - middle[1]) / (away - w) / slope[1]];
      cells.add(Math.floor(12 * (place[0] + 1)) * 100 + Math.floor(12 * (place[1] + 1)));
    }
    const world = (w) => [0, 1, 2].map((axis) => middle[0] * right[axis] + middle[1] * up[axis] + w * back[axis]);
    return { covered: cells.size, target: world(inner), position: world(away) };
  }

  /** Move there; without a flight where it is sudden, or where people asked for less motion. */
  lookAt(target, position, isSudden = matchMedia("(prefers-reduced-motion: reduce)").matches) {
    const ends = [new THREE.Vector3(...target), new THREE.Vector3(...position)];
    const starts = [this.controls.target.clone(), this.camera.position.clone()];
    const flight = (this.flight = {});
    const begun = performance.now();
    const step = (now) => {
      if (this.flight !== flight) return;
      const share = isSudden ? 1 : Math.min(Math.max((now - begun) / FLIGHT_MS, 0), 1);
      const eased = share * share * (3 - 2 * share);
      this.controls.target.lerpVectors(starts[0], ends[0], eased);
      this.camera.position.lerpVectors(starts[1], ends[1], eased);
      this.controls.update();
      this.changed();
      if (share < 1) requestAnimationFrame(step);
      else this.flight = undefined;
    };
    step(begun);
  }

  /** Fly to something of that size; from steeply above, so that little stands in between. */
  flyTo(centre, size) {
    const back = this.camera.position.clone().sub(this.controls.target);
    const flat = Math.hypot(back.x, back.y) || 1e-6;
    const rise = Math.max(back.z, LEAST_RISE * flat);
    const half = Math.tan((this.camera.fov * Math.PI) / 360);
    const share = Math.min(this.free.width, this.free.height) / this.window.height;
    const away = Math.max(NEAREST_FLIGHT, (0.8 * size) / (half * share));
    const position = new THREE.Vector3(back.x, back.y, rise).normalize().multiplyScalar(away);
    this.lookAt(centre, position.add(new THREE.Vector3(...centre)).toArray());
  }

  /** Keep the view where the map's origin moves by so many metres. */
  shift(metres) {
    const by = new THREE.Vector3(...metres);
    this.camera.position.add(by);
    this.controls.target.add(by);
    this.controls.update();
  }

  /** Pixels of a place in the window, and whether it is in front of the eye. */
  project(point) {
    const at = new THREE.Vector3(...point).project(this.camera);
    return { x: ((at.x + 1) / 2) * this.window.width, y: ((1 - at.y) / 2) * this.window.height, isSeen: at.z < 1 };
  }
}
