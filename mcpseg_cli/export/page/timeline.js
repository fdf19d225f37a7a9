// The slider of scans: the map grows, with its labels as they were, or as they are now.

const PLAY_S = 20; // a whole run plays in this time, a short one faster
const LEAST_SCANS_PER_S = 4;

class Timeline {
  constructor(viewer) {
    this.viewer = viewer;
    this.slider = element("scan");
    this.slider.oninput = () => { this.stop(); this.show(); };
    element("play").onclick = () => this.toggle();
    element("final").onchange = () => this.show();
  }

  /** Take the scans of a map; a slider at its end stays there. */
  read() {
    const { slider } = this;
    const isAtEnd = !this.last || Number(slider.value) >= this.last;
    this.last = this.viewer.facts.num_scans;
    slider.max = this.last;
    if (isAtEnd) slider.value = this.last;
    this.show();
  }

  show() {
    const { viewer, slider, last } = this;
    const scan = Number(slider.value);
    viewer.showScan(scan, element("final").checked);
    const seen = viewer.columns.scan_ends[scan - 1];
    element("moment").textContent = `scan ${count(scan)} of ${count(last)}, ${count(seen)} points`;
  }

  stop() {
    this.started = undefined;
    element("play").textContent = "▶";
    element("play").setAttribute("aria-label", "play");
  }

  toggle() {
    if (this.started) { this.stop(); return; }
    if (Number(this.slider.value) >= this.last) this.slider.value = 1;
    this.started = { ms: performance.now(), scan: Number(this.slider.value) };
    element("play").textContent = "❚❚";
    element("play").setAttribute("aria-label", "pause");
    this.show();
    requestAnimationFrame((now) => this.step(now));
  }

  step(now) {
    if (!this.started) return;
    const rate = Math.max(this.last / PLAY_S, LEAST_SCANS_PER_S);
    const due = this.started.scan + Math.floor(Math.max(now - this.started.ms, 0) / 1000 * rate);
    if (due > Number(this.slider.value)) {
      this.slider.value = Math.min(due, this.last);
      this.show();
    }
    if (due >= this.last) this.stop();
    else requestAnimationFrame((later) => this.step(later));
  }
}
