// A tile as it is on the disk, and whether it is to be seen.

/** The arrays of a tile's points from its planes of bytes, see tiled_map.py. */
function unpack({ points: n, low, step }, planes, { lowest_floor, floor_step }) {
  const [at, facing] = [new Uint16Array(4 * n), new Int8Array(4 * n)];
  const [paint, label] = [new Uint8Array(4 * n), new Uint32Array(n)];
  for (let k = 0; k < n; k++) {
    const byte = (plane) => planes[plane * n + k];
    for (let axis = 0; axis < 3; axis++) {
      at[4 * k + axis] = byte(2 * axis) | (byte(2 * axis + 1) << 8);
      facing[4 * k + axis] = byte(6 + axis);
      paint[4 * k + axis] = byte(9 + axis);
    }
    const floor = lowest_floor + floor_step * (byte(17) | (byte(18) << 8));
    const height = low[2] + step * at[4 * k + 2] - floor;
    at[4 * k + 3] = Math.min(Math.max((height - HEIGHT_LOW) / HEIGHT_STEP, 0), 65535);
    facing[4 * k + 3] = byte(13) >> 1;
    label[k] = (byte(12) << 24) | byte(14) | (byte(15) << 8) | (byte(16) << 16);
  }
  return { at, facing, paint, label };
}

/** The six sides of what a camera sees, [a, b, c, d] each: a x + b y + c z + d is above 0 inside. */
function sidesOf(m) {
  const line = (row) => [m[row], m[row + 4], m[row + 8], m[row + 12]];
  const last = line(3);
  return [0, 1, 2].flatMap((row) => [1, -1].map((sign) => line(row).map((value, k) => last[k] + sign * value)));
}

/** Whether a cube is wholly outside of a side. */
function isBehind(a, b, c, d, [x, y, z], half) {
  return a * x + b * y + c * z + d + half * (Math.abs(a) + Math.abs(b) + Math.abs(c)) < 0;
}

/** What the graphics card gets of a tile. */
function geometryOf({ at, facing, paint, label }) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(at, 4, false));
  geometry.setAttribute("normal", new THREE.BufferAttribute(facing, 4, true));
  geometry.setAttribute("paint", new THREE.BufferAttribute(paint, 4, true));
  geometry.setAttribute("label", new THREE.BufferAttribute(label, 1, false));
  geometry.boundingSphere = new THREE.Sphere();
  return geometry;
}

/** List in a table which eighths of every tile shown are shown, too, and where those are listed. */
function listShown(shown, frame, table) {
  const { data } = table.image;
  const order = shown.slice(0, 1); // the uppermost
  for (let k = 0; k < order.length; k++) {
    const first = order.length;
    let eighths = 0;
    order[k].place = k;
    for (let eighth = 0; eighth < 8; eighth++) {
      const below = order[k].below[eighth];
      if (below?.frame !== frame) continue;
      eighths |= 1 << eighth;
      order.push(below);
    }
    data.set([eighths, first & 255, (first >> 8) & 255, first >> 16], 4 * k);
  }
  table.needsUpdate = true;
}
