// The map of a run of `mcpseg segment` on a page. These scripts stand in one element, in the order of
// html.py; three.js draws. Points are kept in the order they were first seen in: a point's place is its `row`.
"use strict";

let viewer; // of this page, for whoever looks at it with the tools of a browser
const element = (id) => document.getElementById(id);
const count = (number) => number.toLocaleString("en");

/** Make an element with these properties, and children or text. */
function make(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

/** Undo base64. */
function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

/** Undo zlib. */
async function inflate(packed) {
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** The bytes that a script element of the page holds; it is emptied. */
function embedded(id) {
  const bytes = fromBase64(element(id).textContent.trim());
  element(id).remove();
  return inflate(bytes);
}

/** Run three.js, which then is the global THREE. */
async function loadLibrary() {
  const url = URL.createObjectURL(new Blob([await embedded("library")], { type: "text/javascript" }));
  await new Promise((resolve, reject) => {
    const script = make("script", { src: url, onload: resolve });
    script.onerror = () => reject(new Error("the drawing library cannot be run"));
    document.head.append(script);
  });
  URL.revokeObjectURL(url);
}

/** The columns of a map by name: typed arrays over one buffer. */
function columnsOf(facts, { buffer }) {
  const types = {
    u1: Uint8Array, i1: Int8Array, u2: Uint16Array, u4: Uint32Array, i4: Int32Array, f4: Float32Array,
  };
  const columns = {};
  for (const { name, type, offset, length } of facts.columns) columns[name] = new types[type](buffer, offset, length);
  return columns;
}

/** What a server gives as a map: facts and columns. */
async function readMap(bytes) {
  const end = 4 + new DataView(bytes.buffer).getUint32(0, true);
  const facts = JSON.parse(new TextDecoder().decode(bytes.subarray(4, end)));
  return { facts, columns: columnsOf(facts, await inflate(bytes.subarray(end))) };
}

/** The bytes at an address beside the page. */
async function fetchBytes(address, options) {
  const answer = await fetch(address, options);
  if (!answer.ok) throw new Error(`${address}: ${answer.status}`);
  return new Uint8Array(await answer.arrayBuffer());
}

/** The number of the first entry of ascending `ends` that is above `value`. */
function firstAbove(ends, value) {
  let [low, high] = [0, ends.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (ends[middle] > value) high = middle;
    else low = middle + 1;
  }
  return low;
}
