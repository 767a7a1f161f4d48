// What the page holds, and how curves are cut to what can be drawn. No request leaves the page.
'use strict';

const page = JSON.parse(document.getElementById('data').textContent);
const inUnit = (seconds) => seconds / page.unit.seconds;

/** Bytes that were deflated and written in base64. */
async function unpack(text) {
  const bytes = Uint8Array.from(atob(text), (one) => one.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Arrays by name: all first bytes of the float32 numbers come first, then all second ones. */
async function unpackArrays(packed) {
  const bytes = await unpack(packed.data);
  const count = bytes.length / 4;
  const ordered = new Uint8Array(bytes.length);
  for (let byte = 0; byte < 4; byte += 1) {
    for (let i = 0; i < count; i += 1) ordered[4 * i + byte] = bytes[byte * count + i];
  }
  const arrays = {};
  let start = 0;
  for (const [name, length] of Object.entries(packed.lengths)) {
    arrays[name] = new Float32Array(ordered.buffer, 4 * start, length);
    start += length;
  }
  return arrays;
}

/**
 * Part of a curve as points to draw: the smallest and the largest value of each of `most` spans,
 * in the order in which they come; everything where there is less than that.
 * With a flag, only the spans in which it is set.
 */
function thin({ run: number, name, flag }, from, to, most) {
  const run = page.runs[number];
  const curve = run.arrays[name];
  const marks = flag ? run.arrays[flag] : null;
  const begin = Math.max(0, Math.floor(from / run.spacing) - 2);
  const end = Math.min(curve.length, Math.ceil(to / run.spacing) + 3);
  const group = Math.max(1, Math.ceil((end - begin) / most));
  const x = [];
  const y = [];
  const put = (i, value) => { x.push(inUnit(i * run.spacing)); y.push(value); };
  for (let start = begin - (begin % group); start < end; start += group) {
    const stop = Math.min(curve.length, start + group);
    let low = -1;
    let high = -1;
    let marked = !marks;
    for (let i = start; i < stop; i += 1) {
      if (curve[i] < curve[low] || (low < 0 && !Number.isNaN(curve[i]))) low = i;
      if (curve[i] > curve[high] || (high < 0 && !Number.isNaN(curve[i]))) high = i;
      if (marks && marks[i] > 0) marked = true;
    }
    const isDrawn = low >= 0 && marked;
    put(start, isDrawn ? curve[Math.min(low, high)] : null);
    if (isDrawn && (marks || low !== high)) {
      put(start + group / (marks ? 1 : 2), curve[Math.max(low, high)]);
    }
  }
  return { x, y };
}

/** Every so many elements, and the last; scaled. */
function pick(array, most, scale, begin = 0, end = array.length - 1) {
  const step = Math.max(1, Math.ceil((end - begin) / most));
  const out = [];
  for (let i = begin; i < end; i += step) out.push(array[i] * scale);
  if (end >= begin && array.length) out.push(array[end] * scale);
  return out;
}

/** Smallest and largest of some arrays, gaps left out; nothing of them may be finite. */
function extent(arrays) {
  let low = Infinity;
  let high = -Infinity;
  for (const array of arrays) {
    for (const value of array.filter((one) => one !== null)) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return low <= high ? [low, high] : [0, 0];
}
