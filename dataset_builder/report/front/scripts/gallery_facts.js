// What a gallery shows: examples that pass the filters, in order; the filters as the hash of an address.
"use strict";
const GalleryFacts = (() => {
  const CHOICES = { split: "Split", scene: "Scene", object: "Object", category: "Category", light: "Light",
    lights: "Lamps", level_name: "Noise level" };
  const RANGES = { error: { title: "Relative error", unit: "" }, seconds: { title: "Seconds", unit: "s" },
    noise: { title: "Displacement", unit: "radii" } };
  const SORTS = { key: "Key", split: "Split", scene: "Scene", object: "Object", category: "Category", light: "Light",
    lights: "Lamps", level: "Noise level", noise: "Displacement", seconds: "Seconds", error: "Relative error" };
  const BINS = 40, WIDE = 30; // histograms whose values span more than this factor have a logarithmic axis
  const TEXT = ["q", "sort", "of", ...Object.keys(CHOICES)];

  const empty = () => ({ q: "", sort: "key", of: "", ranges: {}, ...Object.fromEntries(
    Object.keys(CHOICES).map((name) => [name, ""])) });

  // An example's value for a filter or an order; null where it has none. of: the layer whose error counts, or "" for
  // the largest.
  function number(example, name, of) {
    if (name !== "error") return example[name] ?? null;
    if (of) return example.errors[of] ?? null;
    const all = Object.values(example.errors);
    return all.length ? Math.max(...all) : null;
  }

  // Whether an example passes all filters, or all but that of the range `but`.
  function passes(example, query, words, but) {
    for (const name in CHOICES) if (query[name] !== "" && String(example[name]) !== query[name]) return false;
    for (const name in query.ranges) {
      if (name === but) continue;
      const value = number(example, name, query.of), [low, high] = query.ranges[name];
      if (value === null || value < low || value > high) return false;
    }
    return words.every((word) => example.text.includes(word));
  }

  const words = (query) => query.q.toLowerCase().split(/\s+/).filter(Boolean);

  // Examples with the text that a search looks into.
  function searchable(examples) {
    return examples.map((example) => ({ ...example,
      text: ["key", ...Object.keys(CHOICES)].map((name) => example[name]).join("\n").toLowerCase() }));
  }

  // Examples that pass, in order; those without a value come last, equal ones in the order of their keys.
  function select(examples, query) {
    const asked = words(query), down = query.sort.startsWith("-"), name = query.sort.replace("-", "");
    const found = examples.filter((example) => passes(example, query, asked));
    const rows = found.map((example) => [number(example, name, query.of), example]);
    rows.sort(([a, first], [b, second]) => {
      if (a === b) return compare(first.key, second.key);
      if (a === null || b === null) return a === null ? 1 : -1;
      return down ? compare(b, a) : compare(a, b);
    });
    return rows.map(([, example]) => example);
  }

  function compare(a, b) {
    return typeof a === "number" && typeof b === "number" ? a - b : a < b ? -1 : a > b ? 1 : 0;
  }

  // A histogram's axis from the values of all examples; null where they do not differ.
  function axis(examples, name, of) {
    const values = examples.map((example) => number(example, name, of)).filter((value) => value !== null);
    const low = Math.min(...values), high = Math.max(...values);
    if (!(high > low)) return null;
    const log = low > 0 && high / low > WIDE;
    const [from, to] = log ? [Math.log(low), Math.log(high)] : [low, high];
    return { low, high, share: (value) => ((log ? Math.log(Math.max(value, low)) : value) - from) / (to - from),
      value: (share) => log ? Math.exp(from + share * (to - from)) : from + share * (to - from) };
  }

  // How many examples lie in each bin of an axis, of all and of those that pass the other filters.
  function bins(examples, query, name, scale) {
    const asked = words(query), all = new Uint32Array(BINS), passing = new Uint32Array(BINS);
    for (const example of examples) {
      const value = number(example, name, query.of);
      if (value === null) continue;
      const bin = Math.min(BINS - 1, Math.floor(scale.share(value) * BINS));
      all[bin]++;
      if (passes(example, query, asked, name)) passing[bin]++;
    }
    return { all, passing };
  }

  // Values of a field with the number of examples that have them; none where all have the same.
  function options(examples, name) {
    const counts = new Map();
    for (const example of examples) counts.set(example[name], (counts.get(example[name]) ?? 0) + 1);
    const order = name === "level_name" ? new Map(examples.map((one) => [one.level_name, one.level])) : null;
    const sorted = [...counts].sort(([a], [b]) => order ? order.get(a) - order.get(b) : compare(a, b));
    return sorted.length > 1 ? sorted.map(([value, count]) => ({ value: String(value ?? ""), count })) : [];
  }

  // The text of a query and of the open example after "#", without what is as at the start.
  function toHash(query, open) {
    const params = new URLSearchParams(), start = empty();
    for (const name of TEXT) if (query[name] !== start[name]) params.set(name, query[name]);
    for (const [name, [low, high]] of Object.entries(query.ranges)) params.set(name, `${low}~${high}`);
    if (open) params.set("open", open);
    return params.toString();
  }

  function fromHash(hash) {
    const params = new URLSearchParams(hash.replace(/^#/, "")), query = empty();
    for (const name of TEXT) if (params.has(name)) query[name] = params.get(name);
    if (!(query.sort.replace("-", "") in SORTS)) query.sort = "key";
    for (const name in RANGES) {
      const [low, high] = (params.get(name) ?? "").split("~").map((text) => text ? Number(text) : NaN);
      if (high >= low) query.ranges[name] = [low, high];
    }
    return { query, open: params.get("open") };
  }

  return { CHOICES, RANGES, SORTS, BINS, empty, number, passes, searchable, select, axis, bins, options, toHash,
    fromHash };
})();
