// Colours of spheres: by error, speed or island.

// viridis at equal distances, which the colour-blind read too
const STOPS = [
  [68, 1, 84], [65, 68, 135], [42, 120, 142], [34, 168, 132], [122, 209, 81], [253, 231, 37],
].map((rgb) => rgb.map((value) => value / 255));

export const GRADIENT = `linear-gradient(90deg, ${STOPS.map(
  (rgb) => `rgb(${rgb.map((value) => Math.round(255 * value)).join(' ')})`,
).join(', ')})`;

// Colour of a share 0 to 1 into `out` at `at`, in linear light as three.js takes it.
export function ramp(share, out, at) {
  const place = Math.min(Math.max(share, 0), 1) * (STOPS.length - 1);
  const low = Math.min(Math.floor(place), STOPS.length - 2);
  for (let part = 0; part < 3; part += 1) {
    const value = STOPS[low][part] + (place - low) * (STOPS[low + 1][part] - STOPS[low][part]);
    out[at + part] = value ** 2.2;
  }
}

// Errors from a thousandth of a radius to ten radii, by decades.
export const errorShare = (error, radius) => (Math.log10(Math.max(error / radius, 1e-9)) + 3) / 4;

// The island of each sphere: the least number of those it is connected with by touching.
// Surfaces belong to none. Spheres are swept along x, so that few pairs are looked at.
export function islands(positions, radii, parent, order) {
  const count = radii.length;
  for (let sphere = 0; sphere < count; sphere += 1) { parent[sphere] = sphere; order[sphere] = sphere; }
  const root = (sphere) => {
    while (parent[sphere] !== sphere) { parent[sphere] = parent[parent[sphere]]; sphere = parent[sphere]; }
    return sphere;
  };
  order.sort((one, other) => positions[3 * one] - positions[3 * other]);
  const largest = radii.reduce((most, radius) => Math.max(most, radius), 0);
  for (let first = 0; first < count; first += 1) {
    const i = order[first];
    for (let second = first + 1; second < count; second += 1) {
      const j = order[second];
      const reach = 1.01 * (radii[i] + radii[j]);  // positions are rounded: 1 % apart still touch
      const x = positions[3 * j] - positions[3 * i];
      if (x > 1.01 * (radii[i] + largest)) break;
      const y = positions[3 * j + 1] - positions[3 * i + 1];
      const z = positions[3 * j + 2] - positions[3 * i + 2];
      if (x * x + y * y + z * z > reach * reach) continue;
      const one = root(i);
      const other = root(j);
      if (one < other) parent[other] = one; else parent[one] = other;
    }
  }
  for (let sphere = 0; sphere < count; sphere += 1) parent[sphere] = root(sphere);
}

// A colour for each island, the same as long as its least sphere is; grey for a sphere alone.
export function islandColours(parent, sizes, out) {
  sizes.fill(0);
  for (const island of parent) sizes[island] += 1;
  for (let sphere = 0; sphere < parent.length; sphere += 1) {
    const island = parent[sphere];
    const hue = (island * 0.6180339887) % 1;
    for (let part = 0; part < 3; part += 1) {
      const wave = Math.abs(((hue + (3 - part) / 3) % 1) * 6 - 3) - 1;
      const value = sizes[island] > 1 ? 0.25 + 0.6 * Math.min(Math.max(wave, 0), 1) : 0.62;
      out[3 * sphere + part] = value ** 2.2;
    }
  }
}
