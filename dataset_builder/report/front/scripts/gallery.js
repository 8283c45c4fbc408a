// The gallery of a dataset: filters, the grid, rejected examples, and the viewer of one example.
"use strict";
const GalleryPayloads = (() => {
  const KEPT = 8; // payloads in memory
  const loaded = new Map(), waiting = new Map();

  // Payload of an example: of an element of this page, or of a script beside it, which also works without a server.
  async function load(key, base) {
    if (loaded.has(key)) return loaded.get(key);
    const payload = base ? await fromScript(key, base) : await fromElement(key);
    loaded.set(key, payload);
    if (loaded.size > KEPT) loaded.delete(loaded.keys().next().value);
    return payload;
  }

  async function fromElement(key) {
    const find = () => document.querySelector(`script[data-key="${CSS.escape(key)}"]`);
    // Elements come after this script; a large page may still be read
    if (!find() && document.readyState === "loading") {
      await new Promise((done) => document.addEventListener("DOMContentLoaded", done, { once: true }));
    }
    if (!find()) throw new Error(`This page does not hold the layers of ${key}.`);
    return Vue.markRaw(JSON.parse(find().textContent));
  }

  function fromScript(key, base) {
    return new Promise((done, failed) => {
      const script = document.createElement("script");
      script.src = `${base}${encodeURIComponent(key)}.js`;
      waiting.set(key, done);
      script.onload = () => {
        script.remove();
        if (waiting.delete(key)) failed(new Error(`${script.src} holds another example.`));
      };
      script.onerror = () => {
        script.remove();
        waiting.delete(key);
        failed(new Error(`${script.src} cannot be loaded.`));
      };
      document.head.append(script);
    });
  }

  // Called by the scripts of examples.
  window.galleryExample = (payload) => {
    waiting.get(payload.key)?.(Vue.markRaw(payload));
    waiting.delete(payload.key);
  };
  return { load };
})();

const Gallery = {
  components: { LayerView, HistogramFilter, LabelTree, ThumbGrid },
  data() {
    const gallery = JSON.parse(document.getElementById("gallery").textContent);
    gallery.examples = GalleryFacts.searchable(gallery.examples);
    return { gallery: Vue.markRaw(gallery), ...GalleryFacts.fromHash(location.hash), tab: "examples", payload: null,
      trouble: "" };
  },
  computed: {
    shown() { return GalleryFacts.select(this.gallery.examples, this.query); },
    names() { return this.shown.map((example) => example.key); },
    choices() {
      return Object.entries(GalleryFacts.CHOICES).map(([name, title]) => ({ name, title,
        options: GalleryFacts.options(this.gallery.examples, name) })).filter((choice) => choice.options.length);
    },
    axes() {
      return Object.fromEntries(Object.keys(GalleryFacts.RANGES).map((name) =>
        [name, GalleryFacts.axis(this.gallery.examples, name, this.query.of)]));
    },
    histograms() {
      return Object.entries(GalleryFacts.RANGES).filter(([name]) => this.axes[name]).map(([name, about]) => ({ name,
        ...about, axis: this.axes[name],
        counts: GalleryFacts.bins(this.gallery.examples, this.query, name, this.axes[name]) }));
    },
    measured() { return [...new Set(this.gallery.examples.flatMap((example) => Object.keys(example.errors)))]; },
    sorts: () => GalleryFacts.SORTS,
    sorted: {
      get() { return this.query.sort.replace("-", ""); },
      set(name) { this.query.sort = name; },
    },
    down() { return this.query.sort.startsWith("-"); },
    filtered() { return GalleryFacts.toHash({ ...this.query, sort: "key" }) !== ""; },
    place() { return this.names.indexOf(this.open); },
    near() { return this.place < 0 ? [] : [this.names[this.place - 1], this.names[this.place + 1]]; },
    hash() { return GalleryFacts.toHash(this.query, this.open); },
    facts() {
      const { about, examples } = this.gallery;
      const all = about.examples > examples.length ? ` of ${about.examples}` : "";
      return [`${examples.length}${all} examples`, about.width && `${about.width} × ${about.height} pixels`,
        about.licence, about.generator].filter(Boolean);
    },
  },
  watch: {
    hash(hash) { if (location.hash.slice(1) !== hash) history.replaceState(null, "", `#${hash}`); },
    open: { immediate: true, handler: "show" },
  },
  mounted() {
    window.addEventListener("hashchange", () => Object.assign(this, GalleryFacts.fromHash(location.hash)));
    window.addEventListener("keydown", (event) => this.key(event));
  },
  methods: {
    range(name, range) {
      if (range) this.query.ranges[name] = range;
      else delete this.query.ranges[name];
    },
    turn() { this.query.sort = (this.down ? "" : "-") + this.sorted; },
    clear() { this.query = { ...GalleryFacts.empty(), sort: this.query.sort }; },
    enter(key) {
      this.scrolled = window.scrollY;
      history.pushState(null, "", `#${GalleryFacts.toHash(this.query, key)}`);
      this.open = key;
    },
    leave() {
      const key = this.open;
      this.open = null;
      this.$nextTick(() => {
        window.scrollTo(0, this.scrolled ?? 0);
        document.querySelector(`[data-card="${CSS.escape(key)}"]`)?.focus({ preventScroll: true });
      });
    },
    async show(key) {
      this.trouble = "";
      if (!key) {
        this.payload = null;
        return;
      }
      try {
        const payload = await GalleryPayloads.load(key, this.gallery.base);
        if (key === this.open) this.payload = payload;
      } catch (error) {
        if (key === this.open) [this.payload, this.trouble] = [null, error.message];
      }
    },
    key(event) {
      if (!this.open || event.altKey || event.ctrlKey || event.metaKey) return;
      if (event.key === "Escape") this.leave();
      if (event.target.closest("input, select")) return;
      const next = { ArrowLeft: this.near[0], ArrowRight: this.near[1] }[event.key];
      if (next) this.open = next;
    },
  },
};
Vue.createApp({ ...Gallery, template: "#gallery-page" }).mount("#page");
