// Mouse, fingers and keys on the scene; measuring.

const CLICK_PIXELS = 6; // a press that moved farther turns the view
const DOUBLE_MS = 350;

class Pointer {
  constructor(viewer, picker, measure) {
    Object.assign(this, { viewer, picker, measure, pressed: new Map() });
    const { canvas } = viewer;
    canvas.addEventListener("pointerdown", (event) => this.down(event), true);
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerleave", () => this.point(-1));
    for (const kind of ["pointerup", "pointercancel"]) window.addEventListener(kind, (event) => this.up(event), true);
  }

  down(event) {
    this.pressed.set(event.pointerId, { x: event.clientX, y: event.clientY, isAlone: this.pressed.size === 0 });
    if (this.pressed.size > 1) for (const press of this.pressed.values()) press.isAlone = false;
    this.viewer.isHeld = true;
    this.point(-1);
  }

  up(event) {
    const press = this.pressed.get(event.pointerId);
    this.pressed.delete(event.pointerId);
    if (!this.pressed.size && this.viewer.isHeld) {
      this.viewer.isHeld = false;
      this.viewer.redraw();
    }
    if (!press || event.type === "pointercancel" || event.button !== 0 || !press.isAlone) return;
    if (Math.hypot(event.clientX - press.x, event.clientY - press.y) < CLICK_PIXELS) this.click(event);
  }

  /** A second click on the same place shows the picked object alone, wherever the view has flown to. */
  async click(event) {
    const last = this.lastClick;
    this.lastClick = { ms: event.timeStamp, x: event.clientX, y: event.clientY };
    const isDouble = last && event.timeStamp - last.ms < DOUBLE_MS
      && Math.hypot(event.clientX - last.x, event.clientY - last.y) < 3 * CLICK_PIXELS;
    if (isDouble && !this.measure.isOn) {
      this.lastClick = undefined;
      await this.picking;
      if (this.viewer.state.picked > 0) this.picker.isolate(this.viewer.state.picked);
      return;
    }
    const use = (row) => (this.measure.isOn ? this.measure.add(row) : this.picker.pickPoint(row));
    this.picking = pointAt(this.viewer, event.clientX, event.clientY).then(use);
  }

  move(event) {
    if (event.pointerType === "touch" || this.pressed.size || this.viewer.eye.flight) return;
    this.at = [event.clientX, event.clientY];
    if (this.isWaiting) return;
    this.isWaiting = true;
    requestAnimationFrame(async () => {
      const row = await pointAt(this.viewer, ...this.at);
      this.isWaiting = false;
      if (!this.pressed.size) this.point(row);
    });
  }

  /** Say what the pointer is over. */
  point(row) {
    const { viewer } = this;
    const owner = row < 0 ? -1 : viewer.cloud.ownerOf(row) || -1;
    if (owner !== viewer.state.hovered) viewer.mark({ hovered: owner });
    const tip = element("tip") ?? element("labels").appendChild(make("div", { id: "tip" }));
    tip.hidden = row < 0;
    if (row < 0) return;
    const object = owner > 0 ? ` #${viewer.columns.object_ids[owner]}` : "";
    tip.textContent = `${viewer.nameOf(viewer.cloud.semanticOf(row))}${object}`;
    tip.style.transform = `translate(${this.at[0] + 14}px, ${this.at[1] + 16}px)`;
  }
}

/** Measures between two points. */
class Measure {
  constructor(viewer) {
    this.viewer = viewer;
    this.rows = [];
    this.label = element("labels").appendChild(make("div", { id: "distance", hidden: true }));
    element("measure").onclick = () => this.switch(!this.isOn);
    viewer.afterDrawing.push(() => this.place());
  }

  switch(isOn) {
    this.isOn = isOn;
    element("measure").setAttribute("aria-pressed", isOn);
    document.body.dataset.measuring = isOn ? "yes" : "";
    if (!isOn) this.rows = [];
    this.draw();
  }

  add(row) {
    if (row < 0) return;
    this.rows = [...(this.rows.length < 2 ? this.rows : []), this.viewer.cloud.positionOf(row)];
    this.draw();
  }

  draw() {
    const cross = ([x, y, z]) => [[[x - 0.06, y, z], [x + 0.06, y, z], MEASURE_COLOUR],
      [[x, y - 0.06, z], [x, y + 0.06, z], MEASURE_COLOUR], [[x, y, z - 0.06], [x, y, z + 0.06], MEASURE_COLOUR]];
    const [from, to] = this.rows;
    this.viewer.lines.measure.set([...this.rows.flatMap(cross), ...(to ? [[from, to, MEASURE_COLOUR]] : [])]);
    this.label.hidden = !to;
    if (to) {
      const [flat, up] = [Math.hypot(to[0] - from[0], to[1] - from[1]), to[2] - from[2]];
      this.label.textContent = `${Math.hypot(flat, up).toFixed(2)} m (${flat.toFixed(2)} across, ${up.toFixed(2)} up)`;
    }
    this.viewer.redraw();
  }

  place() {
    if (this.label.hidden) return;
    const [from, to] = this.rows;
    const at = this.viewer.eye.project(from.map((value, axis) => (value + to[axis]) / 2));
    this.label.style.transform = `translate(${at.x}px, ${at.y}px) translate(-50%, -130%)`;
    this.label.style.visibility = at.isSeen ? "" : "hidden";
  }
}

function listenToKeys(viewer, picker, timeline, measure) {
  const press = {
    " ": () => timeline?.toggle(),
    Escape: () => { measure.switch(false); picker.clear(); },
    b: () => element("boxes").click(),
    m: () => element("measure").click(),
    f: () => viewer.fit(),
    s: () => saveScreenshot(viewer),
  };
  let isTabbing = false; // whether a control was reached by keys
  window.addEventListener("pointerdown", () => { isTabbing = false; }, true);
  window.addEventListener("keydown", (event) => {
    const { target } = event;
    const isTyping = target.matches?.("input[type=search]");
    if (event.ctrlKey || event.metaKey || event.altKey || (isTyping && event.key !== "Escape")) return;
    if (event.key === "Tab") isTabbing = true;
    if (event.key === " " && isTabbing && target.matches?.("button, input")) return; // it presses that
    const colour = /^[1-9]$/.test(event.key) ? element("colours").children[Number(event.key) - 1] : undefined;
    const action = colour ? () => colour.click() : press[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    if (isTyping) target.blur();
    action();
  });
}
