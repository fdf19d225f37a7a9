// A map in tiles: those that matter on the screen are loaded and drawn, with at most so many points. A tile has an
// even sample of its cube, without the points of the tiles above it; its eighths have what is between.

const MOST_POINTS = 2_000_000; // at first; a slider changes it
const LEAST_GAP = 1.5; // pixels between the points of a tile above which its eighths are shown, too
const LOADS = 6; // at a time
const KEPT = 1.5; // so many times what may be drawn is kept in memory
const RETRY_MS = 2000;
const TOGETHER_MS = 60; // tiles that arrive within this time are drawn together
const LEAST_SAMPLE = 1500; // points that stand for the map where it is fitted
const MOST_TILES = 16 * TABLE_WIDTH; // drawn at once
const MOST_BOXES = 2000; // around objects
const ROWS = 2 ** 24; // a point's row is its place in its tile, and so many times the tile's number

class TiledCloud extends Cloud {
  constructor(facts, columns, changed) {
    super(facts, columns);
    this.changed = changed;
  }

  makePoints() {
    const { facts, uniforms } = this;
    this.points = new THREE.Scene();
    this.budget = window.innerWidth < NARROW ? MOST_POINTS / 2 : MOST_POINTS;
    this.highest = facts.highest;
    this.table = tableOf(new Uint8Array(4 * MOST_TILES), TABLE_WIDTH, MOST_TILES / TABLE_WIDTH);
    const perTile = { share: { value: 0 }, spacing: { value: 1 }, first: { value: 0 }, tile: { value: 0 } };
    Object.assign(uniforms, perTile, { drawn: { value: this.table } });
    this.makeMaterial(TILE_VERTEX);
    Object.assign(this, { shown: [], top: [], waiting: [], loading: 0, kept: 0, frame: 0, total: 1 });
    this.plant();
    this.paintObjects();
  }

  /** Make the tree of the tiles, none of them loaded. */
  plant() {
    const { tile_levels, tile_places, tile_points } = this.columns;
    const { corner, depth, cells, steps } = this.facts.tiles;
    const byName = new Map();
    this.tiles = [...tile_levels].map((level, number) => {
      const place = tile_places.subarray(3 * number, 3 * number + 3);
      const spacing = 2 ** (depth - level);
      const edge = spacing * cells * this.facts.voxel_size;
      const low = corner.map((value, axis) => value + edge * place[axis]);
      const tile = {
        number, level, edge, low, spacing, step: steps[level], points: tile_points[number], below: [], frame: -1,
        name: `${level}/${place.join("_")}`, isThere: tile_points[number] === 0, retry: 0,
      };
      byName.set(tile.name, tile);
      if (level > 0) {
        const above = byName.get(`${level - 1}/${Array.from(place, (value) => value >> 1).join("_")}`);
        above.below[(place[0] & 1) | ((place[1] & 1) << 1) | ((place[2] & 1) << 2)] = tile;
        tile.above = above;
      }
      return tile;
    });
  }

  /** Load the tiles of the uppermost levels; they stay, and stand for the map where it is fitted. */
  async loadTop() {
    let level = [this.tiles[0]];
    for (let found = 0; level.length && found < LEAST_SAMPLE; ) {
      await Promise.all(level.map((tile) => this.load(tile)));
      this.top.push(...level);
      found += level.reduce((sum, tile) => sum + tile.points, 0);
      level = level.flatMap((tile) => tile.below.filter(Boolean));
    }
  }

  /** Choose the tiles to draw, largest on the screen first, and load what is missing. */
  choose(eye, height, most) {
    const wanted = this.wanted(eye, height);
    const now = performance.now();
    this.waiting = wanted.filter((tile) => !tile.isThere && tile.retry < now);
    document.body.dataset.loading = this.waiting.length + this.loading;

    for (const { mesh } of this.shown) if (mesh) mesh.visible = false;
    this.frame++;
    this.shown = [];
    let chosen = 0;
    this.total = 1;
    for (const tile of wanted) {
      tile.wantedAt = this.frame;
      if (!tile.isThere) continue;
      this.total += tile.points;
      if (chosen + tile.points > most && chosen) continue;
      if (this.shown.length === MOST_TILES) break;
      if (tile.above && tile.above.frame !== this.frame) continue;
      Object.assign(tile, { first: chosen, frame: this.frame });
      this.shown.push(tile);
      chosen += tile.points;
    }
    listShown(this.shown, this.frame, this.table);
    this.drop();
    this.loadMore();
    return { chosen, growth: 1 };
  }

  /** Tiles to be seen, as far as there are points for them; a tile comes after the one above it. */
  wanted(eye, height) {
    const { camera } = eye;
    const sides = sidesOf(camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse).elements);
    const { x, y, z } = camera.position;
    const scale = (camera.projectionMatrix.elements[5] * height) / 2;
    const found = [];
    const look = (tile) => {
      const half = tile.edge / 2;
      const middle = tile.low.map((value) => value + half);
      if (sides.some(([a, b, c, d]) => isBehind(a, b, c, d, middle, half))) return;
      const away = Math.hypot(...[x, y, z].map((value, axis) => Math.max(Math.abs(value - middle[axis]) - half, 0)));
      tile.gap = (tile.spacing * this.facts.voxel_size * scale) / Math.max(away, camera.near);
      found.push(tile);
      if (!tile.isThere || tile.gap < LEAST_GAP) return;
      for (const below of tile.below) if (below) look(below);
    };
    look(this.tiles[0]);
    found.sort((a, b) => b.gap - a.gap || a.level - b.level || a.number - b.number);

    let points = 0;
    const end = found.findIndex((tile) => (points += tile.points) > this.budget && tile.level > 0);
    return end < 0 ? found : found.slice(0, end);
  }

  limit(start, number) {
    for (const { mesh, first } of this.shown) if (mesh) mesh.visible = first >= start && first < start + number;
  }

  /** Give back the memory of tiles that have not been wanted for longest. */
  drop() {
    if (this.kept <= KEPT * this.budget) return;
    const idle = this.tiles.filter((tile) => tile.mesh && tile.wantedAt !== this.frame && !this.top.includes(tile));
    idle.sort((a, b) => (a.wantedAt ?? 0) - (b.wantedAt ?? 0));
    for (const tile of idle) {
      if (this.kept <= this.budget) return;
      this.points.remove(tile.mesh);
      tile.mesh.geometry.dispose();
      Object.assign(tile, { mesh: undefined, isThere: false, at: undefined, facing: undefined, label: undefined });
      this.kept -= tile.points;
    }
  }

  loadMore() {
    while (this.loading < LOADS && this.waiting.length) {
      const tile = this.waiting.shift();
      if (!tile.isThere && !tile.isLoading) this.loadWanted(tile);
    }
  }

  async loadWanted(tile) {
    this.loading++;
    try {
      await this.load(tile);
      if (element("message").dataset.of === "tiles") element("message").textContent = "";
    } catch (error) {
      tile.retry = performance.now() + RETRY_MS;
      setTimeout(() => this.changed(), RETRY_MS + 1);
      Object.assign(element("message"), { textContent: `A tile cannot be loaded (${error.message ?? error}); it is tried again.` });
      element("message").dataset.of = "tiles";
    }
    this.loading--;
    this.loadMore();
    this.arrived ??= setTimeout(() => {
      this.arrived = undefined;
      this.changed();
    }, TOGETHER_MS);
  }

  /** Load a tile and make it ready to be drawn. */
  async load(tile) {
    if (tile.isThere || tile.isLoading) return;
    tile.isLoading = true;
    try {
      const planes = await inflate(await fetchBeside(`tiles/${tile.name}.bin`));
      if (planes.length !== 19 * tile.points) throw new Error(`${tile.name}: of another map; load the page again`);
      this.makeMesh(tile, planes);
      this.kept += tile.points;
      tile.isThere = true;
    } finally {
      tile.isLoading = false;
    }
  }

  makeMesh(tile, planes) {
    const arrays = unpack(tile, planes, this.facts.tiles);
    tile.mesh = new THREE.Points(geometryOf(arrays), this.material);
    Object.assign(tile.mesh, { frustumCulled: false, visible: false });
    Object.assign(tile, { at: arrays.at, facing: arrays.facing, label: arrays.label });

    const { uniforms, material } = this;
    const low = new THREE.Vector3(...tile.low);
    tile.mesh.onBeforeRender = () => {
      uniforms.low.value = low;
      uniforms.step.value = tile.step;
      uniforms.share.value = tile.step / tile.edge;
      uniforms.spacing.value = tile.spacing;
      uniforms.first.value = tile.first;
      uniforms.tile.value = tile.place;
      material.uniformsNeedUpdate = true;
    };
    this.points.add(tile.mesh);
  }

  rowReader() {
    const { shown } = this;
    const starts = shown.map(({ first }) => first);
    return (number) => {
      const tile = shown[firstAbove(starts, number) - 1];
      return tile?.mesh && number < tile.first + tile.points ? tile.number * ROWS + number - tile.first : -1;
    };
  }

  tileOf(row) {
    return this.tiles[Math.floor(row / ROWS)];
  }

  positionOf(row) {
    const tile = this.tileOf(row);
    return tile.low.map((value, axis) => value + tile.step * tile.at[4 * (row % ROWS) + axis]);
  }

  heightOf(row) {
    return HEIGHT_LOW + HEIGHT_STEP * this.tileOf(row).at[4 * (row % ROWS) + 3];
  }

  semanticOf(row) {
    return this.tileOf(row).label[row % ROWS] >>> 24;
  }

  confidenceOf(row) {
    return this.tileOf(row).facing[4 * (row % ROWS) + 3] / 127;
  }

  ownerOf(row) {
    return this.tileOf(row).label[row % ROWS] & 0xffffff;
  }

  /** Places of the objects that boxes are drawn around: those nearest to what is looked at. */
  boxed(target) {
    const { object_sizes, object_boxes } = this.columns;
    const away = (k) => Math.hypot(...[0, 1, 2].map((axis) => object_boxes[7 * k + axis] - target[axis]));
    const near = [...object_sizes.keys()].filter((k) => k && object_sizes[k]).map((k) => [away(k), k]);
    return near.sort((a, b) => a[0] - b[0]).slice(0, MOST_BOXES).map(([, k]) => k);
  }

  firstSeenOf() {
    return [];
  }

  hasSeen() {
    return true;
  }

  floorOf(owner) {
    return this.columns.object_floors[owner];
  }

  colourBy(how) {
    this.uniforms.mode.value = MODES[how];
  }

  paintObjects() {
    const { object_colours } = this.columns;
    for (let k = 0; k < object_colours.length / 3; k++) {
      this.objectTable.set(object_colours.subarray(3 * k, 3 * k + 3), 4 * k);
      this.objectTable[4 * k + 3] = PLAIN;
    }
    this.marked = [];
    this.only = -1;
  }

  /** As of a whole map, but looking at those alone whose mark changes: there may be a million objects. */
  markObjects({ picked, hovered, only }) {
    const changed = only === this.only ? this.marked : this.columns.object_ids.keys();
    for (const k of changed) this.objectTable[4 * k + 3] = only >= 0 && k !== only ? HIDDEN : PLAIN;
    this.marked = [hovered, picked].filter((k) => k >= 0);
    this.only = only;
    for (const k of this.marked) if (only < 0 || k === only) this.objectTable[4 * k + 3] = k === picked ? PICKED : HOVERED;
    this.uniforms.isPicking.value = picked >= 0 && only < 0;
    this.uniforms.objects.value.needsUpdate = true;
  }

  /** Rows of an even sample of what is to be seen. */
  sample(most) {
    const found = [];
    for (const tile of this.top) {
      for (let k = 0; k < tile.points; k++) {
        const isSeen = tile.at[4 * k + 3] <= this.uniforms.cut.value && this.classTable[4 * (tile.label[k] >>> 24) + 3]
          && this.objectTable[4 * (tile.label[k] & 0xffffff) + 3] > HIDDEN;
        if (isSeen) found.push(tile.number * ROWS + k);
      }
    }
    const every = Math.max(1, Math.ceil(found.length / most));
    return found.filter((_, k) => k % every === 0);
  }
}
