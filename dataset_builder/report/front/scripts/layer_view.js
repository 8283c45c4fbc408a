// The layers of one example: side by side or under a wiper, under one exposure, with the label beside them.
"use strict";
const LayerView = {
  components: { LayerCanvas, LayerCaption, LabelTree },
  props: { example: Object },
  data() {
    return { layers: [], trouble: "", auto: 1, held: null, stops: 0, zoom: 1, wiping: false, first: "", second: "",
      place: 50, hidden: [], falseLight: false, pixel: null };
  },
  computed: {
    factor() { return (this.held ?? this.auto) * 2 ** this.stops; },
    exposure() {
      return `× ${Figures.short(this.factor)}, ${this.stops < 0 ? "−" : "+"}${Math.abs(this.stops).toFixed(1)} EV`;
    },
    shown() { return this.layers.filter((layer) => !this.hidden.includes(layer.name)); },
    pair() { return [this.first, this.second].map((name) => this.layers.find((layer) => layer.name === name)); },
    common() {
      const { width, height } = this.example;
      return { width, height, factor: this.factor, falseLight: this.falseLight, pixel: this.pixel };
    },
    where() { return this.pixel ? `pixel ${this.pixel.x}, ${this.pixel.y}` : "point at a picture to read its values"; },
    size() { return `${this.example.width} × ${this.example.height}`; },
    clip() { return { clipPath: `inset(0 0 0 ${this.place}%)` }; },
    frame() {
      return { width: `${this.example.width * this.zoom}px`, height: `${this.example.height * this.zoom}px` };
    },
    card() { return { width: `${Math.max(216, this.example.width * this.zoom)}px` }; },
    names() { return this.layers.map((layer) => layer.name); },
  },
  watch: { example: { immediate: true, handler: "open" } },
  methods: {
    async open() {
      const example = this.example;
      try {
        const layers = await Layers.decodeAll(example);
        if (example !== this.example) return;
        if (!this.layers.length) this.zoom = example.width >= 200 ? 1 : example.width >= 100 ? 2 : 4;
        this.layers = Vue.markRaw(layers);
        this.trouble = "";
        this.auto = Layers.exposure(layers);
        const choice = (...names) => names.find((name) => this.names.includes(name)) ?? "";
        this.first = choice(this.first, "i_s", this.names[0]);
        this.second = choice(this.second, "i_t", this.names.at(-1));
      } catch (error) {
        this.layers = [];
        this.trouble = `The layers cannot be decoded: ${error.message}`;
      }
      this.pixel = null;
    },
    errorsOf(layer) { return this.layers.find((one) => one.name === `${layer.name}_se`) ?? null; },
    toggle(name) {
      this.hidden = this.hidden.includes(name) ? this.hidden.filter((one) => one !== name) : [...this.hidden, name];
    },
    wipe(event) {
      const box = event.currentTarget.getBoundingClientRect();
      if (event.buttons) this.place = Math.min(100, Math.max(0, (event.clientX - box.left) / box.width * 100));
    },
  },
  template: `
    <article class="layer-view">
      <header class="head">
        <div class="title"><h1>{{ example.title }}</h1><span v-if="example.note" class="badge">{{ example.note }}</span>
        </div>
        <p class="quiet">{{ example.key }} <span class="dot">·</span> {{ size }} pixels
          <span class="dot">·</span> {{ where }}</p>
      </header>
      <div class="tools" role="toolbar" aria-label="Picture">
        <label class="exposure">Exposure
          <input type="range" min="-10" max="10" step="0.1" v-model.number="stops" aria-label="Exposure in stops">
          <output :data-factor="factor">{{ exposure }}</output></label>
        <button type="button" @click="stops = 0; held = null">Automatic</button>
        <label title="Keep this exposure for the next example"><input type="checkbox" :checked="held !== null"
          @change="held = $event.target.checked ? auto : null"> hold</label>
        <label><input type="checkbox" v-model="falseLight"> false colour</label>
        <span class="choice" role="group" aria-label="Size">
          <button v-for="one in [1, 2, 4]" type="button" :aria-pressed="zoom === one" @click="zoom = one">{{ one }}×
          </button></span>
        <span class="choice" role="group" aria-label="Arrangement">
          <button type="button" :aria-pressed="!wiping" @click="wiping = false">Side by side</button>
          <button type="button" :aria-pressed="wiping" @click="wiping = true">Wiper</button></span>
      </div>
      <p v-if="trouble" class="trouble" role="alert">{{ trouble }}</p>
      <div class="columns">
        <div v-if="!wiping" class="pictures">
          <div class="chips" role="group" aria-label="Layers shown">
            <button v-for="layer in layers" type="button" :aria-pressed="!hidden.includes(layer.name)"
              @click="toggle(layer.name)">{{ layer.name }}</button></div>
          <figure v-for="layer in shown" :key="layer.name" :style="card">
            <LayerCanvas v-bind="common" :layer="layer" :zoom="zoom" @pixel="pixel = $event" />
            <LayerCaption v-bind="common" :layer="layer" :errors="errorsOf(layer)" />
          </figure>
        </div>
        <div v-else-if="pair[0] && pair[1]" class="pictures wiper">
          <div class="chips">
            <label>left <select v-model="first"><option v-for="name in names">{{ name }}</option></select></label>
            <input type="range" min="0" max="100" step="0.5" v-model.number="place" aria-label="Place of the wiper">
            <label><select v-model="second"><option v-for="name in names">{{ name }}</option></select> right</label>
          </div>
          <div class="stack" :style="frame" @pointerdown.prevent="wipe" @pointermove="wipe">
            <LayerCanvas v-bind="common" :layer="pair[0]" :zoom="zoom" @pixel="pixel = $event" />
            <LayerCanvas v-bind="common" :layer="pair[1]" :zoom="zoom" :style="clip" @pixel="pixel = $event" />
            <i class="blade" :style="{ left: place + '%' }"></i>
          </div>
          <div class="legends"><figure v-for="layer in pair"><LayerCaption v-bind="common" :layer="layer"
            :errors="errorsOf(layer)" /></figure></div>
        </div>
        <LabelTree :value="example.label" />
      </div>
    </article>`,
};
