// What is under the pointer, and what is said about what was picked.

const PICK_PIXELS = 9;

/** The point nearest to a pixel of the window among those drawn around it, or -1. */
async function pointAt(viewer, x, y) {
  const { cloud } = viewer;
  const rowOf = cloud.rowReader();
  const ids = await viewer.idsAt(x, y, PICK_PIXELS);
  const middle = PICK_PIXELS >> 1;
  let [best, bestAway] = [-1, Infinity];
  ids.forEach((id, k) => {
    const away = Math.hypot((k % PICK_PIXELS) - middle, Math.floor(k / PICK_PIXELS) - middle);
    if (id && away < bestAway) [best, bestAway] = [id - 1, away];
  });
  return best < 0 || cloud !== viewer.cloud ? -1 : rowOf(best);
}

/** What is known of a point, as pairs of name and text. */
function describePoint({ facts, columns, cloud }, row) {
  const owner = cloud.ownerOf(row);
  const size = columns.object_sizes[owner];
  const place = cloud.positionOf(row).map((metres, axis) => (metres + facts.origin[axis]).toFixed(2));
  const pairs = [
    ["object", owner ? `${columns.object_ids[owner]}${size ? ` (${count(size)} points)` : ""}` : "none"],
    ["confidence", cloud.confidenceOf(row).toFixed(2)],
    ...cloud.firstSeenOf(row),
    ["height", `${cloud.heightOf(row).toFixed(2)} m`],
    ["x y z", `${place.join("  ")} m`],
  ];
  return size ? [...pairs, sizePair(columns, owner)] : pairs;
}

function sizePair({ object_boxes }, owner) {
  const sides = [3, 4, 5].map((k) => object_boxes[7 * owner + k].toFixed(2));
  return ["box", `${sides.join(" × ")} m`];
}

/** What is known of a whole object. */
function describeObject({ columns }, owner) {
  return [
    ["object", `${columns.object_ids[owner]} (${count(columns.object_sizes[owner])} points)`],
    ["confidence", (columns.object_confidences[owner] / 255).toFixed(2)],
    sizePair(columns, owner),
  ];
}

class Picker {
  constructor(viewer) {
    this.viewer = viewer;
    element("unpick").onclick = () => this.clear();
    element("isolate").onclick = () => this.isolate(viewer.state.only < 0 ? viewer.state.picked : -1);
    element("fly").onclick = () => this.flyTo(viewer.state.picked);
  }

  /** Pick the object of a point, or nothing (-1), and fly there. */
  pickPoint(row) {
    if (row < 0) { this.clear(); return; }
    const { viewer } = this;
    const owner = viewer.cloud.ownerOf(row);
    viewer.mark({ picked: owner || -1 });
    this.show(viewer.nameOf(viewer.cloud.semanticOf(row)), describePoint(viewer, row));
    this.flyTo(owner || -1);
  }

  pickObject(owner) {
    const { viewer } = this;
    viewer.mark({ picked: owner });
    this.show(viewer.nameOf(viewer.columns.object_classes[owner]), describeObject(viewer, owner));
    this.flyTo(owner);
  }

  show(title, pairs) {
    element("picked").hidden = false;
    element("picked").querySelector("h2").textContent = title;
    const entries = pairs.flatMap(([name, text]) => [make("dt", {}, name), make("dd", {}, text)]);
    element("picked").querySelector("dl").replaceChildren(...entries);
    const hasObject = this.viewer.state.picked > 0;
    for (const id of ["isolate", "fly"]) element(id).disabled = !hasObject;
    this.showIsolation();
    this.viewer.onPick?.();
    this.viewer.resize(); // on a phone the card takes part of the window
  }

  /** Show an object by itself, or all again (-1). */
  isolate(owner) {
    this.viewer.mark({ only: owner });
    this.showIsolation();
  }

  showIsolation() {
    element("isolate").setAttribute("aria-pressed", this.viewer.state.only >= 0);
  }

  flyTo(owner) {
    const { columns, eye } = this.viewer;
    if (owner <= 0 || !columns.object_sizes[owner]) return;
    const box = columns.object_boxes.subarray(7 * owner, 7 * owner + 7);
    eye.flyTo([...box.subarray(0, 3)], Math.hypot(box[3], box[4], box[5]));
  }

  clear() {
    element("picked").hidden = true;
    this.viewer.mark({ picked: -1, only: -1, hovered: -1 });
    this.viewer.onPick?.();
    this.viewer.resize();
  }
}
