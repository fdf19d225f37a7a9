// What is shown of a map: which scans, labels, classes, objects and heights, in which colours.

const PATH_COLOUR = [1, 1, 1, 0.9];
const CLEAR_PATH = 500; // scans; the path of more would cover a building
const MEASURE_COLOUR = [1, 1, 1, 1];

class Viewer extends Stage {
  constructor(canvas) {
    super(canvas);
    this.state = { picked: -1, hovered: -1, only: -1 };
    this.hiddenClasses = new Set(); // names
    this.scan = 0;
    this.isFinal = false;
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
    this.cloud = facts.tiles ? new TiledCloud(facts, columns, () => this.redraw()) : new Cloud(facts, columns);
    this.scene.add(this.cloud.points);
    this.eye.setReach(Math.hypot(...[0, 1, 2].map((axis) => 2 * Math.abs(facts.low[axis]))));
    if (view) {
      this.eye.shift([0, 1, 2].map((axis) => view.origin[axis] - facts.origin[axis]));
      Object.assign(this.state, { picked: this.placeOf(view.picked), only: this.placeOf(view.only), hovered: -1 });
    }
    this.showPath(this.isPathShown ?? !(facts.tiles && facts.num_scans > CLEAR_PATH));
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
    this.lines.robot.set(this.isPathShown && !this.facts.tiles ? scannerMark(place, floors[scan - 1], PATH_COLOUR) : []);
    this.drawBoxes();
  }

  showPath(isShown) {
    this.isPathShown = isShown;
    const { path } = this.columns;
    const poses = path.length / 3;
    const at = (k) => path.subarray(3 * k, 3 * k + 3);
    const stretches = Array.from({ length: poses - 1 }, (_, k) => [at(k), at(k + 1), PATH_COLOUR]);
    this.lines.path.set(isShown ? stretches : []);
    if (this.scan) this.showScan(Math.min(this.scan, poses), this.isFinal);
    else this.redraw();
  }

  showBoxes(areShown) {
    this.areBoxesShown = areShown;
    this.drawBoxes();
  }

  /** Boxes around the objects of now that have been seen by the moment shown, and around the picked one. */
  drawBoxes() {
    const { object_sizes, object_boxes, object_classes, class_colours } = this.columns;
    const stretches = [];
    for (const k of this.areBoxesShown ? this.cloud.boxed(this.eye.controls.target.toArray()) : []) {
      const isShown = k && object_sizes[k] && this.cloud.hasSeen(k, this.scan) && !this.hiddenClasses.has(this.nameOf(object_classes[k]));
      if (!isShown || (this.state.only >= 0 && k !== this.state.only)) continue;
      const box = this.belowCut(object_boxes.subarray(7 * k, 7 * k + 7), this.cloud.floorOf(k));
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
  belowCut([x, y, z, length, width, height, yaw], floor) {
    const cut = floor + this.cloud.cut;
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
