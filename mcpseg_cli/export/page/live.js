// A page of `mcpseg view` follows its run: it asks its server whether the map has grown.

const ASK_MS = 2000;

async function follow(viewer, moment, show) {
  let [last, isLost] = [moment, false];
  for (;;) {
    await new Promise((resolve) => setTimeout(resolve, ASK_MS));
    if (document.hidden) continue;
    try {
      const current = await (await ask("moment")).text();
      if (current !== last) {
        const bytes = new Uint8Array(await (await ask("map")).arrayBuffer());
        const end = 4 + new DataView(bytes.buffer).getUint32(0, true);
        const facts = JSON.parse(new TextDecoder().decode(bytes.subarray(4, end)));
        show(facts, columnsOf(facts, await inflate(bytes.subarray(end))));
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

async function ask(what) {
  const answer = await fetch(what, { cache: "no-store" });
  if (!answer.ok) throw new Error(`${answer.status}`);
  return answer;
}
