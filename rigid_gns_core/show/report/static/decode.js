// Poses out of the text that packing.py made: base64, deflated, differences in time.

const bytesOf = (text) => Uint8Array.from(atob(text), (character) => character.charCodeAt(0));

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Response(stream).arrayBuffer();
}

// Sums along time, in place; integers wrap around as the differences did.
function accumulate(values, frames) {
  for (let row = 0; row < values.length; row += frames) {
    for (let index = row + 1; index < row + frames; index += 1) values[index] += values[index - 1];
  }
  return values;
}

// One trajectory: `positions` and `quaternions` are integers, [sphere][component][frame].
export class Track {
  static async of(packed, frames, count) {
    const [positions, quaternions] = await Promise.all([
      inflate(bytesOf(packed.positions.data)), inflate(bytesOf(packed.quaternions.data)),
    ]);
    const track = new Track();
    track.frames = frames;
    track.count = count;
    track.offset = packed.positions.offset;
    track.scale = packed.positions.scale;
    track.positions = accumulate(new Int16Array(positions), frames);
    track.quaternions = accumulate(new Int8Array(quaternions), frames);
    return track;
  }

  // Centres [m] at a time in frames, linear between two, into `out`: 3 numbers per sphere.
  positionsAt(time, out) {
    const { frames, count, offset, scale, positions } = this;
    const before = Math.min(Math.floor(time), frames - 1);
    const after = Math.min(before + 1, frames - 1);
    const share = time - before;
    for (let sphere = 0, at = 0; sphere < count; sphere += 1) {
      for (let axis = 0; axis < 3; axis += 1, at += 1) {
        const row = at * frames;
        const level = positions[row + before] * (1 - share) + positions[row + after] * share;
        out[at] = offset[axis] + scale[axis] * level;
      }
    }
  }

  // Unit quaternions (x, y, z, w), the shorter way between two frames: 4 numbers per sphere.
  quaternionsAt(time, out) {
    const { frames, count, quaternions } = this;
    const before = Math.min(Math.floor(time), frames - 1);
    const after = Math.min(before + 1, frames - 1);
    const share = time - before;
    for (let sphere = 0; sphere < count; sphere += 1) {
      const row = 4 * sphere * frames;
      let dot = 0;
      for (let part = 0; part < 4; part += 1) {
        dot += quaternions[row + part * frames + before] * quaternions[row + part * frames + after];
      }
      const sign = dot < 0 ? -share : share;
      let norm = 0;
      for (let part = 0; part < 4; part += 1) {
        const one = quaternions[row + part * frames + before];
        const value = one * (1 - share) + quaternions[row + part * frames + after] * sign;
        out[4 * sphere + part] = value;
        norm += value * value;
      }
      norm = Math.sqrt(norm) || 1;
      for (let part = 0; part < 4; part += 1) out[4 * sphere + part] /= norm;
    }
  }

  // Speeds [m/s] over the frame that a time is in, `step` [s] apart, into `out`.
  speedsAt(time, step, out) {
    const { frames, count, scale, positions } = this;
    const after = Math.min(Math.max(Math.ceil(time), 1), frames - 1);
    const before = Math.max(after - 1, 0);
    for (let sphere = 0; sphere < count; sphere += 1) {
      let square = 0;
      for (let axis = 0; axis < 3; axis += 1) {
        const row = (3 * sphere + axis) * frames;
        square += (scale[axis] * (positions[row + after] - positions[row + before])) ** 2;
      }
      out[sphere] = Math.sqrt(square) / step;
    }
  }
}
