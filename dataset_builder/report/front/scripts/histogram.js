// A histogram whose bars are brushed to filter; the two fields below do the same for the keyboard.
"use strict";
const HistogramFilter = {
  props: { title: String, unit: String, axis: Object, counts: Object, range: Array },
  emits: ["range"],
  computed: {
    bars() {
      const most = Math.max(1, ...this.counts.all), width = 100 / this.counts.all.length;
      const bar = (count) => count ? Math.max(1.5, 46 * count / most) : 0;
      return Array.from(this.counts.all, (count, bin) => ({ x: bin * width, width: width * 0.86, all: bar(count),
        passing: bar(this.counts.passing[bin]), inside: this.inside(bin) }));
    },
    brush() {
      if (!this.range) return null;
      const [from, to] = this.range.map((value) => 100 * Math.min(1, Math.max(0, this.axis.share(value))));
      return { x: from, width: Math.max(0.6, to - from) };
    },
  },
  methods: {
    short: Figures.short,
    inside(bin) {
      if (!this.range) return true;
      const count = this.counts.all.length, [low, high] = this.range.map(this.axis.share);
      return (bin + 1) / count > low - 1e-9 && bin / count <= high + 1e-9;
    },
    share(event) {
      const box = this.$refs.plot.getBoundingClientRect();
      return Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
    },
    start(event) {
      this.from = this.share(event);
      this.$refs.plot.setPointerCapture(event.pointerId);
    },
    move(event) {
      if (this.from === undefined) return;
      const [low, high] = [this.from, this.share(event)].sort((a, b) => a - b);
      if (high - low > 0.01) this.choose(low, high);
    },
    end(event) {
      if (this.from !== undefined && Math.abs(this.share(event) - this.from) <= 0.01) this.$emit("range", null);
      this.from = undefined;
    },
    // The ends are exact, so that the least and the largest stay in.
    choose(low, high) {
      const value = (share) => Number(this.axis.value(share).toPrecision(4));
      this.$emit("range", [low > 0 ? value(low) : this.axis.low, high < 1 ? value(high) : this.axis.high]);
    },
    type(side, event) {
      const range = [...(this.range ?? [this.axis.low, this.axis.high])], value = event.target.valueAsNumber;
      range[side] = Number.isFinite(value) ? value : [this.axis.low, this.axis.high][side];
      if (range[1] >= range[0]) this.$emit("range", range);
    },
  },
  template: `
    <section class="histogram">
      <header><h3>{{ title }}</h3><slot></slot>
        <button v-if="range" type="button" class="link" @click="$emit('range', null)">all</button></header>
      <svg ref="plot" viewBox="0 0 100 48" preserveAspectRatio="none" @pointerdown.prevent="start" @pointermove="move"
        @pointerup="end" @pointercancel="from = undefined" :aria-label="title" role="img">
        <rect v-if="brush" class="brush" :x="brush.x" y="0" :width="brush.width" height="48" />
        <template v-for="bar in bars">
          <rect class="all" :x="bar.x" :y="48 - bar.all" :width="bar.width" :height="bar.all" />
          <rect :class="bar.inside ? 'in' : 'out'" :x="bar.x" :y="48 - bar.passing" :width="bar.width"
            :height="bar.passing" />
        </template>
      </svg>
      <div class="ends">
        <input type="number" step="any" :value="short(range ? range[0] : axis.low)" @change="type(0, $event)"
          :aria-label="title + ', from'"><span>{{ unit }}</span>
        <input type="number" step="any" :value="short(range ? range[1] : axis.high)" @change="type(1, $event)"
          :aria-label="title + ', to'">
      </div>
    </section>`,
};
