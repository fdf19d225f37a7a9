// The page opens.

async function main() {
  const facts = JSON.parse(element("facts").textContent);
  const [cloud] = await Promise.all([embedded("cloud"), loadLibrary()]);
  const viewer = new Viewer(element("canvas"));
  const picker = new Picker(viewer);
  const measure = new Measure(viewer);
  const timeline = new Timeline(viewer);
  const list = new ObjectList(viewer, picker);
  const show = (newFacts, columns) => {
    viewer.setMap(newFacts, columns);
    showSummary(viewer);
    makeLegend(viewer);
    timeline.read();
    makeHeightSlider(viewer);
    list.read();
  };
  show(facts, columnsOf(facts, cloud));
  makeColourButtons(viewer);
  makeViewButtons(viewer);
  makeFolding(viewer);
  new Pointer(viewer, picker, measure);
  listenToKeys(viewer, picker, timeline, measure);
  viewer.fit(undefined, undefined, true);
  element("message").textContent = "";
  document.body.dataset.state = "ready";
  if (facts.moment !== null) follow(viewer, facts.moment, show);
}

main().catch((error) => {
  element("message").textContent = `This page cannot be shown: ${error.message ?? error}`;
  document.body.dataset.state = "failed";
});
