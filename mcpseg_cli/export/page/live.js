// A page of `mcpseg view` follows its run: it asks its server whether the map has grown.

const ASK_MS = 2000;
const FRESH = { cache: "no-store" };

async function follow(viewer, moment, show) {
  let [last, isLost] = [moment, false];
  for (;;) {
    await new Promise((resolve) => setTimeout(resolve, ASK_MS));
    if (document.hidden) continue;
    try {
      const current = new TextDecoder().decode(await fetchBytes("moment", FRESH));
      if (current !== last) {
        const { facts, columns } = await readMap(await fetchBytes("map", FRESH));
        show(facts, columns);
        last = facts.moment;
      }
      if (isLost) element("message").textContent = "";
      isLost = false;
    } catch {
      isLost = true;
      element("message").textContent = "The server has ended; what was shown last stays.";
    }
  }
}
