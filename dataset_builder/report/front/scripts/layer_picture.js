// One layer as a picture with its caption: values under the pointer, their errors, the scale of false colour.
"use strict";
const Figures = {
  // Five digits tell every half float from its neighbours.
  exact: (value) => Number.isFinite(value) ? String(Number(value.toPrecision(5))) : String(value),
  short: (value) => Number.isFinite(value) ? String(Number(value.toPrecision(3))) : String(value),
  percent: (share) => `${Number((100 * share).toPrecision(2))} %`,
};

const LayerCanvas = {
  props: { layer: Object, width: Number, height: Number, factor: Number, falseLight: Boolean, zoom: Number,
    pixel: Object },
  emits: ["pixel"],
  computed: {
    size() { return { width: `${this.width * this.zoom}px`, height: `${this.height * this.zoom}px` }; },
    label() { return `${this.layer.name}, ${this.layer.meaning}. Arrow keys read pixels.`; },
    mark() {
      return this.pixel && { left: `${this.pixel.x * this.zoom}px`, top: `${this.pixel.y * this.zoom}px`,
        width: `${this.zoom}px`, height: `${this.zoom}px` };
    },
  },
  watch: {
    layer() { this.paint(); },
    factor() { if (this.layer.look === "light") this.paint(); },
    falseLight() { if (this.layer.look === "light") this.paint(); },
  },
  mounted() { this.paint(); },
  methods: {
    paint() {
      cancelAnimationFrame(this.frame);
      this.frame = requestAnimationFrame(() => {
        const pixels = Layers.paint(this.layer, this.factor, this.falseLight);
        const image = new ImageData(new Uint8ClampedArray(pixels.buffer), this.width, this.height);
        this.$refs.canvas?.getContext("2d").putImageData(image, 0, 0);
      });
    },
    point(event) {
      const box = this.$refs.canvas.getBoundingClientRect();
      const at = (offset, extent, count) => Math.min(count - 1, Math.max(0, Math.floor(offset / extent * count)));
      this.$emit("pixel", { x: at(event.clientX - box.left, box.width, this.width),
        y: at(event.clientY - box.top, box.height, this.height) });
    },
    step(event) {
      const [right, down] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key]
        ?? [];
      if (right === undefined) return;
      event.preventDefault();
      event.stopPropagation();
      const from = this.pixel ?? { x: this.width >> 1, y: this.height >> 1 };
      this.$emit("pixel", { x: Math.min(this.width - 1, Math.max(0, from.x + right)),
        y: Math.min(this.height - 1, Math.max(0, from.y + down)) });
    },
  },
  template: `
    <div class="canvas" :style="size" tabindex="0" role="img" :aria-label="label" @pointermove="point"
      @pointerleave="$emit('pixel', null)" @keydown="step">
      <canvas ref="canvas" :width="width" :height="height" :data-layer="layer.name" :style="size"></canvas>
      <i v-if="mark" class="mark" :style="mark"></i>
    </div>`,
};

const LayerCaption = {
  props: { layer: Object, errors: Object, width: Number, factor: Number, falseLight: Boolean, pixel: Object },
  computed: {
    at() { return this.pixel && this.pixel.y * this.width + this.pixel.x; },
    values() { return this.pixel && Layers.valuesAt(this.layer, this.at).map(Figures.exact).join("  "); },
    spread() {
      if (this.layer.look === "error") return "a standard error";
      if (this.errors) {
        return this.pixel ? "± " + Layers.valuesAt(this.errors, this.at).map(Figures.exact).join("  ") + this.before
          : this.relative;
      }
      return `no error per pixel${this.layer.error === null ? "" : `; ${this.relative}`}`;
    },
    relative() {
      const { error, mean, doubtful } = this.layer;
      return error === null ? ""
        : `relative error ${Figures.percent(error)}${mean && !doubtful ? `, ${mean}` : ""}${this.before}`;
    },
    // Errors are those of the estimate that a denoiser was given
    before() { return this.layer.denoised ? ", before denoising" : ""; },
    scale() { return Layers.scale(this.layer, this.factor, this.falseLight); },
    bar() {
      const stops = Layers.MAPS[this.scale.map].map((stop) => `rgb(${stop.join(" ")})`);
      return { background: `linear-gradient(to right, ${stops.join(", ")})` };
    },
    unit() { return this.layer.unit === "1" ? "" : this.layer.unit.split(",")[0]; },
    remarks() { return Layers.remarks(this.layer); },
    short: () => Figures.short,
  },
  template: `
    <figcaption>
      <div class="name"><b>{{ layer.name }}</b> <span>{{ layer.symbol }}</span>
        <em :title="layer.unit">{{ unit }}</em></div>
      <p class="meaning" :title="layer.meaning">{{ layer.meaning }}</p>
      <div v-if="scale" class="scale">
        <span>{{ short(scale.low) }}</span><i :style="bar"></i><span>{{ short(scale.high) }}</span>
      </div>
      <output :data-values="layer.name">{{ values }}</output>
      <output :class="pixel && errors ? 'spread' : 'said'" :data-spread="layer.name">{{ spread }}</output>
      <p v-for="remark in remarks" class="remark">{{ remark }}</p>
    </figcaption>`,
};
