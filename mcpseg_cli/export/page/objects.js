// The list of objects: searched, sorted; a click picks one.

const MOST_ROWS = 150; // more are found by searching

class ObjectList {
  constructor(viewer, picker) {
    Object.assign(this, { viewer, picker, order: "size" });
    element("search").oninput = () => this.show();
    const buttons = [...element("sort").children];
    for (const button of buttons) {
      button.onclick = () => {
        pressIn(buttons, button, "aria-checked");
        this.order = button.value;
        this.show();
      };
    }
    viewer.onPick = () => this.markPicked();
  }

  /** Take the objects of a map. */
  read() {
    const { columns } = this.viewer;
    this.objects = [];
    for (let k = 1; k < columns.object_sizes.length; k++) {
      if (!columns.object_sizes[k]) continue;
      this.objects.push({
        place: k, id: columns.object_ids[k], size: columns.object_sizes[k],
        confidence: columns.object_confidences[k] / 255, semantic: columns.object_classes[k],
        name: this.viewer.nameOf(columns.object_classes[k]),
      });
    }
    this.show();
  }

  show() {
    const words = element("search").value.toLowerCase().split(/\s+/).filter(Boolean);
    const found = this.objects.filter(({ name, id }) =>
      words.every((word) => name.toLowerCase().includes(word) || String(id) === word.replace("#", "")));
    const orders = {
      size: (a, b) => b.size - a.size,
      class: (a, b) => a.name.localeCompare(b.name) || b.size - a.size,
      confidence: (a, b) => a.confidence - b.confidence,
    };
    found.sort(orders[this.order]);
    element("objects").replaceChildren(...found.slice(0, MOST_ROWS).map((object) => this.row(object)));
    const left = found.length - MOST_ROWS;
    element("more").textContent = left > 0 ? `${count(left)} more: search for them` : `${count(found.length)} objects`;
    this.markPicked();
  }

  row({ place, id, size, confidence, semantic, name }) {
    const swatch = make("span", { className: "swatch" });
    swatch.style.background = `rgb(${this.viewer.columns.class_colours.slice(3 * semantic, 3 * semantic + 3).join()})`;
    const button = make("button", { type: "button", value: place }, swatch, make("span", { className: "name" }, name),
      make("span", { className: "count" }, `#${id}`), make("span", { className: "count" }, count(size)),
      make("span", { className: "count" }, confidence.toFixed(2)));
    button.onclick = () => {
      if (window.innerWidth < NARROW) element("fold").click(); // the panel covers the map there
      this.picker.pickObject(place);
    };
    button.ondblclick = () => this.picker.isolate(place);
    button.onpointerenter = (event) => { if (event.pointerType === "mouse") this.viewer.mark({ hovered: place }); };
    button.onpointerleave = () => this.viewer.mark({ hovered: -1 });
    return make("li", {}, button);
  }

  markPicked() {
    for (const { firstChild } of element("objects").children) {
      firstChild.setAttribute("aria-current", Number(firstChild.value) === this.viewer.state.picked);
    }
  }
}
