// Layers of an example: half floats, kept as their 16-bit codes, and the tables that turn codes into colours.
"use strict";
const Layers = (() => {
  const CODES = 65536;
  const WEIGHTS = [0.2126, 0.7152, 0.0722]; // Rec.709 luminance of linear R, G, B
  const OPAQUE = 0xff000000; // pixels are little-endian RGBA in 32 bits
  const MAPS = {
    length: stops("440154 48186a 472d7b 424086 3b528b 33638d 2c728e 26828e 21918c " +
      "1fa088 28ae80 3fbc73 5ec962 84d44b addc30 d8e219 fde725"),
    error: stops("000004 0a0822 1d1147 36106b 51127c 6a1c81 832681 9c2e7f b73779 " +
      "d0416f e75263 f56b5c fc8961 fea772 fec488 fde2a3 fcfdbf"),
  };
  const NUMBERS = ["000000", "0072b2", "d8d8d8", "e69f00", "009e73", "cc79a7", "56b4e9", "d55e00", "f0e442", "8c564b"];

  // The value of every code (IEEE 754 binary16).
  const VALUES = Float32Array.from({ length: CODES }, (_, code) => {
    const sign = code >> 15 ? -1 : 1, exponent = (code >> 10) & 31, fraction = code & 1023;
    if (exponent === 31) return fraction ? NaN : sign * Infinity;
    return sign * (exponent ? 2 ** (exponent - 15) * (1 + fraction / 1024) : 2 ** -24 * fraction);
  });

  function stops(text) {
    return text.split(" ").map(channels);
  }

  function channels(hex) {
    return [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16));
  }

  function packed(red, green, blue) {
    return (OPAQUE | (blue << 16) | (green << 8) | red) >>> 0;
  }

  // Bytes of base64 text of a zlib stream.
  async function inflated(text) {
    const binary = atob(text);
    const bytes = new Uint8Array(binary.length);
    for (let at = 0; at < bytes.length; at++) bytes[at] = binary.charCodeAt(at);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
  }

  // Codes (C, H, W) of base64 text of zlib-compressed half floats; throws where their number is another.
  async function decode(text, count) {
    const codes = new Uint16Array(await inflated(text));
    if (codes.length !== count) throw new Error(`expected ${count} values, got ${codes.length}`);
    return codes;
  }

  // An example's layers with their codes decoded, and what is shown by one number per pixel worked out.
  async function decodeAll(example) {
    const size = example.width * example.height;
    return Promise.all(example.layers.map(async (layer) => {
      const { data, ...facts } = layer;
      const codes = await decode(data, size * layer.channels);
      return { ...facts, size, codes, counts: histogram(codes), scalar: scalar(layer, codes, size) };
    }));
  }

  // One code per pixel for false colour: luminance of light, the largest channel of others.
  function scalar(layer, codes, size) {
    if (layer.channels === 1) return codes;
    const found = new Uint16Array(size);
    for (let at = 0; at < size; at++) {
      const [a, b, c] = [codes[at], codes[size + at], codes[2 * size + at]];
      found[at] = layer.look === "light"
        ? nearestCode(WEIGHTS[0] * VALUES[a] + WEIGHTS[1] * VALUES[b] + WEIGHTS[2] * VALUES[c])
        : Math.max(a, b, c); // codes of values from 0 on are in the order of the values
    }
    return found;
  }

  const [FLOAT, BITS] = (() => {
    const float = new Float32Array(1);
    return [float, new Uint32Array(float.buffer)];
  })();

  // The code nearest to a value from 0 on; 0 for values below and NaN.
  function nearestCode(value) {
    if (!(value > 0)) return 0;
    if (value < 2 ** -14) return Math.round(value * 2 ** 24);
    FLOAT[0] = value;
    return Math.min(0x7bff, (BITS[0] - 0x38000000 + 0x1000) >>> 13);
  }

  function histogram(codes) {
    const counts = new Uint32Array(CODES);
    for (let at = 0; at < codes.length; at++) counts[codes[at]]++;
    return counts;
  }

  // The value that `share` of all finite values above 0 do not exceed; null where there is none.
  function percentile(counts, share) {
    let total = 0;
    for (let code = 1; code < 0x7c00; code++) total += counts[code];
    let left = Math.max(1, Math.ceil(share * total));
    for (let code = 1; code < 0x7c00; code++) if ((left -= counts[code]) <= 0) return VALUES[code];
    return null;
  }

  // The exposure that brings the 98th percentile of the luminance of all lit pixels of light to 1, as tonemap.exposure.
  function exposure(layers) {
    const counts = new Uint32Array(CODES);
    for (const layer of layers) {
      if (layer.look !== "light") continue;
      for (let at = 0; at < layer.size; at++) counts[layer.scalar[at]]++;
    }
    const white = percentile(counts, 0.98);
    return white === null ? 1 : 1 / white;
  }

  function srgb(linear) {
    const value = Math.min(Math.max(linear, 0), 1);
    return value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055;
  }

  // 8 bits of every code, multiplied by an exposure and sRGB-encoded (IEC 61966-2-1), as tonemap.to_8bit; NaN is 0.
  // The last two are kept: layers share the exposure, and 1 is that of shares.
  const tones = new Map();
  function toneTable(factor) {
    const made = tones.get(factor) ?? Uint8Array.from(VALUES, (value) => Math.round(255 * srgb(value * factor)) || 0);
    tones.delete(factor);
    tones.set(factor, made);
    if (tones.size > 2) tones.delete(tones.keys().next().value);
    return made;
  }

  // 8 bits of every code from -1 to 1, for directions.
  function signedTable() {
    return Uint8Array.from(VALUES, (value) => Math.round(127.5 * (Math.min(Math.max(value, -1), 1) + 1)) || 0);
  }

  function mapColour(name, share) {
    const map = MAPS[name], place = Math.min(Math.max(share || 0, 0), 1) * (map.length - 1);
    const at = Math.min(Math.floor(place), map.length - 2), rest = place - at;
    return map[at].map((low, channel) => Math.round(low + rest * (map[at + 1][channel] - low)));
  }

  // The pixel of every code in false colour between two values; black for values up to 0 where `bare`.
  function colourTable(name, low, high, bare) {
    const span = high - low || 1;
    return Uint32Array.from(VALUES, (value) =>
      bare && !(value > 0) ? OPAQUE >>> 0 : packed(...mapColour(name, (value - low) / span)));
  }

  function numberTable() {
    const palette = NUMBERS.map((hex) => packed(...channels(hex)));
    return Uint32Array.from(VALUES, (value) =>
      value > 0 && Number.isFinite(value) ? palette[1 + ((Math.round(value) - 1) % (NUMBERS.length - 1))] : palette[0]);
  }

  // Values at the ends of a layer's false colour, and its map; null for layers that show colours of their own.
  function scale(layer, factor, falseLight) {
    if (layer.look === "light") return falseLight ? { map: "length", low: 0, high: 1 / factor } : null;
    if (layer.look === "error") return { map: "error", low: 0, high: percentile(layer.counts, 0.99) ?? 1 };
    if (layer.look !== "length") return null;
    const [low, high] = [percentile(layer.counts, 0.005), percentile(layer.counts, 0.995)];
    return { map: "length", low: low ?? 0, high: high ?? 1, bare: true };
  }

  // Pixels (H W) of a layer: every value is one look-up.
  function paint(layer, factor, falseLight) {
    const pixels = new Uint32Array(layer.size), { size, codes } = layer;
    const range = scale(layer, factor, falseLight);
    if (range || layer.look === "number") {
      const table = range ? colourTable(range.map, range.low, range.high, range.bare) : numberTable();
      for (let at = 0; at < size; at++) pixels[at] = table[layer.scalar[at]];
      return pixels;
    }
    const table = layer.look === "direction" ? signedTable() : toneTable(layer.look === "light" ? factor : 1);
    const [green, blue] = layer.channels === 1 ? [0, 0] : [size, 2 * size];
    for (let at = 0; at < size; at++) {
      pixels[at] = OPAQUE | (table[codes[blue + at]] << 16) | (table[codes[green + at]] << 8) | table[codes[at]];
    }
    return pixels;
  }

  // Values of a layer at a pixel, one per channel.
  function valuesAt(layer, at) {
    return Array.from({ length: layer.channels }, (_, channel) => VALUES[layer.codes[channel * layer.size + at]]);
  }

  // What a layer's picture does not show.
  function remarks(layer) {
    const told = [], total = (from, to) => layer.counts.subarray(from, to).reduce((sum, count) => sum + count, 0);
    const below = layer.look === "direction" ? 0 : total(0x8001, 0xfc01);
    const broken = total(0x7c00, 0x8000) + total(0xfc01, CODES);
    if (layer.doubtful) told.push(layer.mean);
    if (layer.denoised) told.push(layer.denoised);
    if (layer.cut) told.push(`${layer.cut} values beyond 65504 are cut there`);
    if (below) told.push(`${below} values below 0 are shown as 0`);
    if (broken) told.push(`${broken} values are infinite or no number`);
    return told;
  }

  return { VALUES, MAPS, inflated, decode, decodeAll, exposure, toneTable, colourTable, nearestCode, mapColour,
           percentile, scale, paint, valuesAt, remarks };
})();
