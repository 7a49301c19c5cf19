// What the page carries, packed by play.py: where joints, markers and points without names are in each frame.
// Places are in mm: x to the right of the front view, y up, z towards the viewer.
"use strict";
const SEEN = 0, DOUBTFUL = 1, FILLED = 2, ABSENT = 3;  // as `MarkerState`
const AXES = [0, 1, 2];
const SMOOTHING = 0.3;  // s before and after, of the middle that the view follows
const SAMPLES = 100;  // frames that tell how large the take is

function mean(points) {
  const known = points.filter((point) => point);
  return known.length ? AXES.map((axis) => known.reduce((sum, point) => sum + point[axis], 0) / known.length) : null;
}

function extent(points) {
  return AXES.map((axis) => {
    const values = points.map((point) => point[axis]);
    return values.reduce((a, b) => Math.max(a, b)) - values.reduce((a, b) => Math.min(a, b));
  });
}

class Take {
  constructor(data) {
    Object.assign(this, data);
    this.nJoints = this.joints.length;
    this.nMarkers = this.names.length;
    this.nPoints = this.nJoints + this.nMarkers;
    this.rate = data.rate / data.stride;  // of the frames that are kept
  }

  async unpack() {
    const packed = Uint8Array.from(atob(this.packed), (letter) => letter.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
    let at = 0;
    const next = (count) => bytes.subarray(at, at += count);
    const words = (count) => {
      const low = next(count), high = next(count);
      return Uint16Array.from(low, (byte, index) => byte + 256 * high[index]);
    };
    this.states = next((this.nPoints + this.limbs.length) * this.nFrames);
    this.places = this.#restored(words(3 * this.nPoints * this.nFrames));
    this.starts = [0];
    for (const count of words(this.nFrames)) this.starts.push(this.starts.at(-1) + count);
    this.cloud = words(3 * this.nCloud);
    this.#survey();
  }

  #restored(values) {  // from second differences over time, axis after axis of point after point
    for (let row = 0; row < values.length; row += this.nFrames) {
      let value = 0, step = 0;
      for (let index = row; index < row + this.nFrames; index++) values[index] = value += step += values[index];
    }
    return values;
  }

  stateOf(point, frame) {
    return this.states[point * this.nFrames + frame];
  }

  isLoose(limb, frame) {  // whether the limb's rotation is interpolated
    return this.stateOf(this.nPoints + limb, frame) > 0;
  }

  pointsAt(frame) {  // joints, markers, then middles of limbs, as bones count them; null where unknown
    const points = Array.from({length: this.nPoints}, (_, point) => this.#placeOf(point, frame));
    return points.concat(this.members.map((members) => mean(members.map((member) => points[member]))));
  }

  #placeOf(point, frame) {
    if (this.stateOf(point, frame) === ABSENT) return null;
    return AXES.map((axis) => this.#inMm(this.places[(3 * point + axis) * this.nFrames + frame], axis));
  }

  cloudAt(frame) {  // points without names
    const indices = Array.from({length: this.starts[frame + 1] - this.starts[frame]}, (_, i) => this.starts[frame] + i);
    return indices.map((index) => AXES.map((axis) => this.#inMm(this.cloud[axis * this.nCloud + index], axis)));
  }

  #inMm(steps, axis) {
    return this.low[axis] + this.step * steps;
  }

  #survey() {  // the middle of each frame, smoothed; how large a typical frame is; how far from its middle points lie
    const seen = Array.from({length: this.nFrames}, (_, frame) => this.#known(frame));
    const sizes = [], radii = [];
    this.middles = this.#smoothed(seen);
    for (let frame = 0; frame < this.nFrames; frame += Math.ceil(this.nFrames / SAMPLES)) {
      if (seen[frame].length < 2) continue;
      const away = (point) => Math.hypot(...AXES.map((axis) => point[axis] - this.middles[frame][axis]));
      sizes.push(Math.hypot(...extent(seen[frame])));
      radii.push(Math.max(...seen[frame].map(away)));
    }
    for (const values of [sizes, radii]) values.sort((a, b) => a - b);
    this.typical = sizes[sizes.length >> 1] || Math.hypot(...extent(this.box)) || 1;
    // Of points without names some are false, and lie anywhere.
    this.reach = radii[this.nPoints ? radii.length - 1 : radii.length >> 1] || this.typical;
  }

  #smoothed(seen) {
    const span = Math.round(SMOOTHING * this.rate), sums = [[0, 0, 0]];
    let middle = mean(this.box);
    for (const points of seen) {
      middle = mean(points) || middle;
      sums.push(AXES.map((axis) => sums.at(-1)[axis] + middle[axis]));
    }
    return seen.map((_, frame) => {
      const from = Math.max(frame - span, 0), to = Math.min(frame + span + 1, seen.length);
      return AXES.map((axis) => (sums[to][axis] - sums[from][axis]) / (to - from));
    });
  }

  #known(frame) {
    return this.nPoints ? this.pointsAt(frame).slice(0, this.nPoints).filter((point) => point) : this.cloudAt(frame);
  }
}
