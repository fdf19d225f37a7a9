// The panel: colours, height, classes, view; it folds.

function pressIn(group, chosen, attribute) {
  for (const button of group) button.setAttribute(attribute, button === chosen);
}

function makeColourButtons(viewer) {
  const buttons = viewer.facts.colours.map((name, place) =>
    make("button", { type: "button", value: name, title: `key ${place + 1}` }, name === "instance" ? "object" : name));
  const choose = (button) => {
    pressIn(buttons, button, "aria-checked");
    element("scale").hidden = button.value !== "confidence";
    viewer.colourBy(button.value);
  };
  for (const button of buttons) {
    button.setAttribute("role", "radio");
    button.onclick = () => choose(button);
    if (button.value === viewer.how) choose(button);
  }
  element("colours").replaceChildren(...buttons);
  const { confidence_colours: ramp } = viewer.columns;
  const stops = [0, 64, 128, 192, 255].map((step) => `rgb(${ramp.slice(3 * step, 3 * step + 3).join()})`);
  element("scale").querySelector("i").style.background = `linear-gradient(90deg, ${stops.join()})`;
}

/** A row for every class: switch it, or show it alone. */
function makeLegend(viewer) {
  const boxes = [];
  const names = viewer.facts.classes.map((entry) => entry.name);
  const show = (isShown) => {
    names.forEach((name, place) => {
      viewer.hiddenClasses[isShown(name) ? "delete" : "add"](name);
      boxes[place].checked = isShown(name);
    });
    viewer.showClasses();
  };
  const rows = viewer.facts.classes.map((entry) => {
    const box = make("input", { type: "checkbox", checked: !viewer.hiddenClasses.has(entry.name) });
    const colour = viewer.columns.class_colours.slice(3 * entry.semantic, 3 * entry.semantic + 3);
    const swatch = make("span", { className: "swatch" });
    swatch.style.background = `rgb(${colour.join()})`;
    const name = make("span", { className: "name" }, entry.name);
    const points = make("span", { className: "count" }, count(entry.num_points));
    const only = make("button", { type: "button", className: "only", ariaLabel: `only ${entry.name}` }, "only");
    box.onchange = () => {
      viewer.hiddenClasses[box.checked ? "delete" : "add"](entry.name);
      viewer.showClasses();
    };
    only.onclick = () => show((other) => other === entry.name);
    boxes.push(box);
    return make("li", {}, make("label", {}, box, swatch, name, points), only);
  });
  element("legend").replaceChildren(...rows);
  element("all").onclick = () => show(() => true);
  element("none").onclick = () => show(() => false);
}

/** The slider of heights; it starts below the ceiling. */
function makeHeightSlider(viewer) {
  const [slider, output] = [element("cut"), element("height")];
  const show = () => {
    const isAll = Number(slider.value) >= Number(slider.max);
    output.textContent = isAll ? "all" : `up to ${Number(slider.value).toFixed(2)} m`;
    viewer.cutAt(isAll ? Infinity : Number(slider.value));
  };
  const reach = () => {
    const isAll = viewer.cut === Infinity;
    slider.min = 0.05;
    slider.max = Math.max(Math.ceil(20 * (viewer.cloud.highest + 0.05)) / 20, 0.5);
    slider.value = isAll || viewer.cut === undefined ? slider.max : viewer.cut;
  };
  const below = () => {
    slider.value = viewer.facts.cut ?? slider.max;
    show();
  };
  reach();
  slider.oninput = show;
  element("below").onclick = below;
  if (viewer.cut === undefined) below();
  else show();
}

function makeViewButtons(viewer) {
  element("fit").onclick = () => viewer.fit();
  element("top").onclick = () => viewer.fit(0, Math.PI / 2 - 0.001);
  element("aslant").onclick = () => viewer.fit(-0.6, 0.75);
  element("size").oninput = (event) => viewer.setSize(Number(event.target.value));
  element("path").onchange = (event) => viewer.showPath(event.target.checked);
  element("boxes").onchange = (event) => viewer.showBoxes(event.target.checked);
  element("shot").onclick = () => saveScreenshot(viewer);
  const isTouch = matchMedia("(pointer: coarse)").matches;
  element("hint").textContent = isTouch
    ? "One finger turns, two move and zoom. Tap picks an object, tap twice shows it alone."
    : "Drag turns, right drag moves, wheel zooms. Click picks an object, double click shows it alone. " +
      `Keys: ${viewer.facts.tiles ? "" : "Space plays, "}1–${viewer.facts.colours.length} colours, B boxes, M measures, F whole map, S screenshot, Esc clears.`;
}

/** Begin with the uppermost tiles; a slider says how many points are drawn, and a line how many are. */
async function beginWithTiles(viewer) {
  const { cloud, facts } = viewer;
  viewer.resize();
  await cloud.loadTop();
  element("budget-row").hidden = false;
  const [slider, output] = [element("budget"), element("drawn")];
  slider.value = cloud.budget / 1e6;
  viewer.eye.controls.addEventListener("end", () => { if (viewer.areBoxesShown) viewer.drawBoxes(); });
  slider.oninput = () => {
    cloud.budget = 1e6 * Number(slider.value);
    viewer.redraw();
  };
  viewer.afterDrawing.push(() => {
    const points = cloud.shown.reduce((sum, tile) => sum + tile.points, 0);
    output.textContent = `${count(points)} of ${count(facts.num_points)} points drawn, at most ${slider.value} million`;
  });
}

/** Save what is to be seen as a picture. */
function saveScreenshot(viewer) {
  viewer.paint(Infinity, 1);
  viewer.canvas.toBlob((blob) => {
    const url = URL.createObjectURL(blob);
    make("a", { href: url, download: `${document.title}.png` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 10_000);
  });
}

function makeFolding(viewer) {
  const fold = (isFolded) => {
    document.body.dataset.folded = isFolded ? "yes" : "";
    element("fold").setAttribute("aria-expanded", !isFolded);
    viewer.resize();
  };
  element("fold").onclick = () => fold(!document.body.dataset.folded);
  const tabs = [...element("tabs").children];
  for (const tab of tabs) {
    tab.onclick = () => {
      pressIn(tabs, tab, "aria-selected");
      for (const { value } of tabs) element(`tab-${value}`).hidden = value !== tab.value;
    };
  }
  fold(window.innerWidth < NARROW);
}

function showSummary({ facts }) {
  const numbers = [[facts.num_points, "points"], [facts.num_objects, "objects"], [facts.num_scans, "scans"]];
  element("summary").textContent = numbers.map(([number, what]) => `${count(number)} ${what}`).join(" · ");
}
