// Lines of some pixels' width: the scanner's path, boxes, a measured distance.

const BOX_EDGES = [[0, 1], [1, 3], [3, 2], [2, 0], [4, 5], [5, 7], [7, 6], [6, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

class Lines {
  constructor(width, hidden, shared) {
    this.width = width;
    this.uniforms = { width: { value: width }, hidden: { value: hidden }, ...shared };
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: LINE_VERTEX, fragmentShader: LINE_FRAGMENT,
      uniforms: this.uniforms, transparent: true, depthTest: false, depthWrite: false, side: THREE.DoubleSide,
    });
    this.mesh = new THREE.Mesh(new THREE.BufferGeometry(), material);
    this.mesh.frustumCulled = false;
    this.set([]);
  }

  /** Draw stretches, each [from, to, [red, green, blue, opacity] of 0 to 1]. */
  set(stretches) {
    const count = stretches.length;
    const [position, other] = [new Float32Array(12 * count), new Float32Array(12 * count)];
    const [tint, side] = [new Float32Array(16 * count), new Float32Array(4 * count)];
    const index = new Uint32Array(6 * count);
    stretches.forEach(([from, to, colour], k) => {
      for (let corner = 0; corner < 4; corner++) {
        const [own, far] = corner < 2 ? [from, to] : [to, from];
        position.set(own, 12 * k + 3 * corner);
        other.set(far, 12 * k + 3 * corner);
        tint.set(colour, 16 * k + 4 * corner);
        side[4 * k + corner] = corner % 2 ? 1 : -1;
      }
      // seen from the other end, left is right
      index.set([0, 1, 2, 0, 2, 3].map((corner) => 4 * k + corner), 6 * k);
    });
    this.mesh.geometry.dispose();
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setAttribute("other", new THREE.BufferAttribute(other, 3));
    geometry.setAttribute("tint", new THREE.BufferAttribute(tint, 4));
    geometry.setAttribute("side", new THREE.BufferAttribute(side, 1));
    geometry.setIndex(new THREE.BufferAttribute(index, 1));
    this.mesh.geometry = geometry;
    this.isEmpty = count === 0;
    this.mesh.visible = !this.isEmpty;
  }

  /** Draw only the first so many stretches. */
  limit(count) {
    this.mesh.geometry.setDrawRange(0, 6 * Math.max(0, count));
  }
}

/** The edges of an upright box: centre, length, width, height, turn about z. */
function boxEdges([x, y, z, length, width, height, yaw], colour) {
  const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
  const corners = [];
  for (let k = 0; k < 8; k++) {
    const u = ((k & 1 ? 1 : -1) * length) / 2, v = ((k & 2 ? 1 : -1) * width) / 2;
    corners.push([x + u * cos - v * sin, y + u * sin + v * cos, z + ((k & 4 ? 1 : -1) * height) / 2]);
  }
  return BOX_EDGES.map(([from, to]) => [corners[from], corners[to], colour]);
}

/** A ring around a place with a plumb line down to the floor. */
function scannerMark([x, y, z], floor, colour) {
  const at = (k) => [x + 0.22 * Math.cos((k * Math.PI) / 8), y + 0.22 * Math.sin((k * Math.PI) / 8), z];
  const ring = Array.from({ length: 16 }, (_, k) => [at(k), at(k + 1), colour]);
  return [...ring, [[x, y, z], [x, y, floor], colour], [[x, y, z], at(0), colour], [[x, y, z], at(8), colour]];
}
