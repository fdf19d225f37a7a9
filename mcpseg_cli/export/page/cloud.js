// The points on the graphics card. They are drawn in an order whose every beginning is an even sample of the map.

const MODES = { rgb: 0, embedding: 0, class: 1, instance: 2, confidence: 3 };
const SURFEL = 1.0; // radius of a point in voxels: surfaces look closed
const [HIDDEN, PLAIN, HOVERED, PICKED] = [0, 120, 190, 255]; // of objects, in the alpha of their table

/** A step that, taken again and again around a circle of `total` places, comes to all of them, far apart. */
function evenStride(total) {
  const greatest = (a, b) => (b ? greatest(b, a % b) : a);
  let stride = Math.max(1, Math.round(0.6180339887 * total));
  while (greatest(stride, total) > 1) stride++;
  return stride % total || 1;
}

function tableOf(data, width, height) {
  const table = new THREE.DataTexture(data, width, height, THREE.RGBAFormat, THREE.UnsignedByteType);
  table.needsUpdate = true;
  return table;
}

/** A (256, 4) table of a (256, 3) one. */
function withAlpha(colours) {
  const table = new Uint8Array(1024).fill(255);
  for (let i = 0; i < 256; i++) table.set(colours.subarray(3 * i, 3 * i + 3), 4 * i);
  return table;
}

class Cloud {
  constructor(facts, columns) {
    Object.assign(this, { facts, columns });
    const lines = Math.ceil(columns.object_ids.length / TABLE_WIDTH);
    this.objectTable = new Uint8Array(4 * TABLE_WIDTH * lines);
    this.classTable = withAlpha(columns.class_colours);
    this.uniforms = {
      low: { value: new THREE.Vector3(...facts.low) }, step: { value: facts.step }, cut: { value: 65535 },
      radius: { value: 0 }, height: { value: 1 }, now: { value: 0 }, mode: { value: 1 },
      isPicking: { value: false }, classes: { value: tableOf(this.classTable, 256, 1) },
      objects: { value: tableOf(this.objectTable, TABLE_WIDTH, lines) },
      ramp: { value: tableOf(withAlpha(columns.confidence_colours), 256, 1) },
    };
    this.makePoints();
  }

  makePoints() {
    this.labels = new Labels(this.facts, this.columns);
    this.total = this.facts.num_points;
    this.order();
    this.makeGeometry();
    this.points = new THREE.Points(this.geometry, this.makeMaterial(WHOLE_VERTEX));
    this.points.frustumCulled = false;
    this.findFirstSeen();
  }

  makeMaterial(vertexShader) {
    return (this.material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader, fragmentShader: POINT_FRAGMENT,
      uniforms: this.uniforms, blending: THREE.NoBlending,
    }));
  }

  /** For every object of now the first scan that saw some of it. */
  findFirstSeen() {
    const { object, object_ids } = this.columns;
    this.firstSeen = new Uint32Array(object_ids.length).fill(0xffffffff);
    for (let row = this.total - 1; row >= 0; row--) this.firstSeen[object[row]] = row;
    for (let k = 0; k < object_ids.length; k++) this.firstSeen[k] = this.scanOf(this.firstSeen[k]);
  }

  /** Whether some of an object of now had been seen after so many scans. */
  hasSeen(owner, scan) {
    return this.firstSeen[owner] < scan;
  }

  /** Choose what to draw, at most so many points; returns how many, and by how much larger each. */
  choose(eye, height, most) {
    const chosen = Math.min(this.total, most);
    return { chosen, growth: Math.min(Math.sqrt(this.total / chosen), 2) };
  }

  /** Have only these of the points chosen drawn, in the order of drawing. */
  limit(start, number) {
    this.geometry.setDrawRange(start, number);
  }

  /** The row of a point by its number in the picture; -1 when the map has become another since. */
  rowReader() {
    return (number) => this.rows[number];
  }

  /** Choose the order of drawing: `rows` tells which point is drawn when, `place` when a point is drawn. */
  order() {
    const { total } = this;
    this.rows = new Uint32Array(total);
    this.place = new Uint32Array(total);
    const stride = evenStride(total);
    for (let j = 0, row = 0; j < total; j++, row = (row + stride) % total) {
      this.rows[j] = row;
      this.place[row] = j;
    }
  }

  makeGeometry() {
    const { total, columns, facts, place } = this;
    const { xyz, normal, confidence, scan_ends, floors } = columns;
    const at = new Uint16Array(4 * total);
    const facing = new Int8Array(4 * total);
    const scans = new Uint32Array(total);
    this.highest = -Infinity;
    for (let row = 0, scan = 0; row < total; row++) {
      while (row >= scan_ends[scan]) scan++;
      const j = place[row];
      const height = facts.low[2] + facts.step * xyz[2 * total + row] - floors[scan];
      for (let axis = 0; axis < 3; axis++) {
        at[4 * j + axis] = xyz[axis * total + row];
        facing[4 * j + axis] = normal[axis * total + row];
      }
      at[4 * j + 3] = Math.min(Math.max((height - HEIGHT_LOW) / HEIGHT_STEP, 0), 65535);
      facing[4 * j + 3] = confidence[row] >> 1;
      scans[j] = scan;
      if (height > this.highest) this.highest = height;
    }
    this.heights = at;
    this.geometry = new THREE.BufferGeometry();
    const add = (name, array, size, isShare) =>
      this.geometry.setAttribute(name, new THREE.BufferAttribute(array, size, isShare)).attributes[name];
    add("position", at, 4, false);
    add("normal", facing, 4, true);
    add("scan", scans, 1, false);
    this.paint = add("paint", new Uint8Array(4 * total), 4, true);
    this.label = add("label", new Uint32Array(total), 1, false);
    this.geometry.boundingSphere = new THREE.Sphere();
  }

  /** Where a point is, metres from the middle of the map. */
  positionOf(row) {
    const { facts, total } = this;
    return [0, 1, 2].map((axis) => facts.low[axis] + facts.step * this.columns.xyz[axis * total + row]);
  }

  heightOf(row) {
    return HEIGHT_LOW + HEIGHT_STEP * this.heights[4 * this.place[row] + 3];
  }

  semanticOf(row) {
    return this.labels.semantic[row];
  }

  confidenceOf(row) {
    return this.columns.confidence[row] / 255;
  }

  /** The object that a point is part of at the moment shown, as its place in `object_ids`. */
  ownerOf(row) {
    return this.labels.objectOf(row);
  }

  /** Places of the objects that boxes are drawn around. */
  boxed() {
    return this.columns.object_ids.keys();
  }

  /** The height of the floor under an object, or under what is shown. */
  floorOf() {
    return this.columns.floors[Math.max(this.uniforms.now.value - 1, 0)];
  }

  /** What is known of when a point was first seen. */
  firstSeenOf(row) {
    return [["first seen", `scan ${count(this.scanOf(row) + 1)}`]];
  }

  scanOf(row) {
    return firstAbove(this.columns.scan_ends, row);
  }

  colourBy(how) {
    this.uniforms.mode.value = MODES[how];
    if (MODES[how] !== 0) return;
    const colours = this.columns[how];
    const { array } = this.paint;
    for (let j = 0; j < this.total; j++) {
      const row = 3 * this.rows[j];
      for (let channel = 0; channel < 3; channel++) array[4 * j + channel] = colours[row + channel];
    }
    this.paint.needsUpdate = true;
  }

  /** Show up to so many metres above the floor. */
  cutAt(height) {
    this.uniforms.cut.value = height >= this.highest ? 65535 : (height - HEIGHT_LOW) / HEIGHT_STEP;
    this.cut = height >= this.highest ? Infinity : height;
  }

  /** Show the map and its labels after so many scans. */
  showScan(scan, isFinal) {
    this.uniforms.now.value = scan;
    const changed = this.labels.goTo(scan, isFinal);
    const now = this.labels;
    if (changed === null || !this.isLabelled) {
      for (let row = 0; row < this.total; row++) this.label.array[this.place[row]] = (now.semantic[row] << 24) | now.object[row];
      this.isLabelled = true;
      this.label.needsUpdate = true;
    } else if (changed.length) {
      for (const row of changed) this.label.array[this.place[row]] = (now.semantic[row] << 24) | now.object[row];
      this.label.needsUpdate = true;
    }
  }

  showClasses(isShown) {
    this.isShown = isShown;
    this.facts.classes.forEach((entry) => { this.classTable[4 * entry.semantic + 3] = isShown(entry) ? 255 : 0; });
    this.uniforms.classes.value.needsUpdate = true;
  }

  /** Mark objects, told by their place: the picked one, the one pointed at, the only one shown; -1 for none. */
  markObjects({ picked, hovered, only }) {
    const { survivor } = this.labels;
    const { object_colours } = this.columns;
    for (let k = 0; k < survivor.length; k++) {
      const owner = survivor[k];
      this.objectTable.set(object_colours.subarray(3 * owner, 3 * owner + 3), 4 * k);
      const isHidden = only >= 0 && owner !== survivor[only];
      const isPicked = picked >= 0 && owner === survivor[picked];
      const isHovered = hovered >= 0 && owner === survivor[hovered];
      this.objectTable[4 * k + 3] = isHidden ? HIDDEN : isPicked ? PICKED : isHovered ? HOVERED : PLAIN;
    }
    this.uniforms.isPicking.value = picked >= 0 && only < 0;
    this.uniforms.objects.value.needsUpdate = true;
  }

  /** Rows of an even sample of what is to be seen. */
  sample(most) {
    const { labels, columns } = this;
    const found = [];
    const end = columns.scan_ends[this.uniforms.now.value - 1];
    const shown = new Uint8Array(256);
    for (let k = 0; k < 256; k++) shown[k] = this.classTable[4 * k + 3];
    for (let j = 0; j < this.total && found.length < most; j++) {
      const row = this.rows[j];
      const isSeen = row < end && this.heights[4 * j + 3] <= this.uniforms.cut.value && shown[labels.semantic[row]]
        && this.objectTable[4 * labels.object[row] + 3] > HIDDEN;
      if (isSeen) found.push(row);
    }
    return found;
  }

  dispose() {
    this.geometry.dispose();
    this.material.dispose();
    for (const name of ["classes", "objects", "ramp"]) this.uniforms[name].value.dispose();
  }
}
