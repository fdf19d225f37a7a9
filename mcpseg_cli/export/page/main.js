// The page opens.

async function main() {
  const [{ facts, columns }] = await Promise.all([openMap(), loadLibrary()]);
  viewer = new Viewer(element("canvas"));
  const picker = new Picker(viewer);
  const measure = new Measure(viewer);
  const timeline = facts.tiles ? undefined : new Timeline(viewer);
  const list = new ObjectList(viewer, picker);
  const show = (newFacts, columns) => {
    viewer.setMap(newFacts, columns);
    showSummary(viewer);
    makeLegend(viewer);
    timeline?.read();
    makeHeightSlider(viewer);
    list.read();
  };
  element("time").hidden = Boolean(facts.tiles);
  show(facts, columns);
  element("path").checked = viewer.isPathShown;
  if (facts.tiles) await beginWithTiles(viewer);
  makeColourButtons(viewer);
  makeViewButtons(viewer);
  makeFolding(viewer);
  new Pointer(viewer, picker, measure);
  listenToKeys(viewer, picker, timeline, measure);
  viewer.fit(undefined, undefined, true);
  element("message").textContent = "";
  document.body.dataset.state = "ready";
  if (facts.moment) follow(viewer, facts.moment, show);
}

/** The map that the page holds, or the one beside it. */
async function openMap() {
  const facts = JSON.parse(element("facts").textContent);
  if (!facts.map) return { facts, columns: columnsOf(facts, await embedded("cloud")) };
  const found = await readMap(await fetchBeside(facts.map));
  const wanted = location.hash.slice(1);
  if (found.facts.colours.includes(wanted)) found.facts.colour = wanted;
  return found;
}

async function fetchBeside(address) {
  try {
    return await fetchBytes(address);
  } catch (error) {
    if (location.protocol !== "file:") throw error;
    throw new Error("browsers load no tiles from a disk; run 'mcpseg view FOLDER', or any web server in its folder");
  }
}

main().catch((error) => {
  element("message").textContent = `This page cannot be shown: ${error.message ?? error}`;
  document.body.dataset.state = "failed";
});
