// Labels as they were after any scan: classes and objects as first seen, and logs that are played to and fro.

class Labels {
  constructor(facts, columns) {
    this.columns = columns;
    this.numScans = facts.num_scans;
    this.past = { semantic: columns.first_semantic, object: columns.first_object, scan: 0 };
    this.isFinal = false;
    this.survivor = new Uint32Array(columns.object_ids.length);
    this.semantic = this.past.semantic;
    this.object = this.past.object;
  }

  /** Go to the labels after so many scans, or to the final ones; returns the rows that changed, null for all. */
  goTo(scan, isFinal) {
    const { columns, past } = this;
    const changed = [];
    this.play(past.semantic, columns.class_ends, columns.class_rows, columns.class_swaps, scan, changed);
    this.play(past.object, columns.move_ends, columns.move_rows, columns.move_swaps, scan, changed);
    past.scan = scan;
    this.merge(isFinal ? 0 : scan);
    const isOther = isFinal !== this.isFinal;
    this.isFinal = isFinal;
    this.semantic = isFinal ? columns.semantic : past.semantic;
    this.object = isFinal ? columns.object : past.object;
    return isOther ? null : isFinal ? [] : changed;
  }

  /** Swap old and new values of all changes between the moment that the labels are of and another. */
  play(values, ends, rows, swaps, scan, changed) {
    const upTo = (number) => (number > 0 ? ends[number - 1] : 0);
    const [from, to] = [upTo(this.past.scan), upTo(scan)];
    const step = to < from ? -1 : 1;
    for (let k = step > 0 ? from : from - 1; step > 0 ? k < to : k >= to; k += step) {
      values[rows[k]] ^= swaps[k];
      changed.push(rows[k]);
    }
  }

  /** Say for every object which it is part of after so many scans. */
  merge(scan) {
    const { survivor } = this;
    const { merges, merge_ends } = this.columns;
    for (let k = 0; k < survivor.length; k++) survivor[k] = k;
    const end = scan > 0 ? merge_ends[scan - 1] : 0;
    for (let k = 0; k < end; k++) survivor[merges[2 * k]] = merges[2 * k + 1];
    for (let k = 0; k < survivor.length; k++) {
      let last = survivor[k];
      while (survivor[last] !== last) last = survivor[last];
      for (let next = k; survivor[next] !== last; ) [next, survivor[next]] = [survivor[next], last];
    }
  }

  /** See `Cloud.ownerOf`. */
  objectOf(row) {
    return this.survivor[this.object[row]];
  }
}
