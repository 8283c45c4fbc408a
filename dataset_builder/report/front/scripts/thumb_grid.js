// A grid of examples that holds only what is near the window, so that thousands scroll smoothly.
"use strict";
const ThumbGrid = (() => {
  const CARD = 176, HEIGHT = 250, SPARE = 2; // least width and height of a card with its gap, rows beyond the window

  return {
    props: { examples: Array, of: String },
    emits: ["open"],
    data() { return { columns: 4, first: 0, rows: 6 }; },
    computed: {
      total() { return Math.ceil(this.examples.length / this.columns); },
      near() {
        const from = Math.min(this.first, Math.max(0, this.total - 1));
        const cards = this.examples.slice(from * this.columns, (from + this.rows) * this.columns);
        return { top: from * HEIGHT, cards };
      },
    },
    mounted() {
      this.observer = new ResizeObserver(() => this.measure());
      this.observer.observe(this.$el);
      this.onScroll = () => this.measure();
      window.addEventListener("scroll", this.onScroll, { passive: true });
    },
    beforeUnmount() {
      this.observer.disconnect();
      window.removeEventListener("scroll", this.onScroll);
    },
    methods: {
      seconds: ({ seconds }) => seconds === null ? "–" : `${Figures.short(seconds)} s`,
      error(example) {
        const value = GalleryFacts.number(example, "error", this.of);
        return value === null ? "–" : Figures.percent(value);
      },
      measure() {
        const box = this.$el.getBoundingClientRect();
        if (!box.width) return;
        this.columns = Math.max(1, Math.floor(box.width / CARD));
        this.first = Math.max(0, Math.floor(-box.top / HEIGHT) - SPARE);
        this.rows = Math.ceil(window.innerHeight / HEIGHT) + 2 * SPARE + 1;
      },
      // Arrow keys move between cards; the next row comes into the window by itself.
      step(event) {
        const by = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -this.columns, ArrowDown: this.columns }[event.key];
        const key = event.target.closest("[data-card]")?.dataset.card;
        const at = this.examples.findIndex((example) => example.key === key);
        const next = by && at >= 0 && this.examples[at + by];
        if (!next) return;
        event.preventDefault();
        for (const card of this.$el.querySelectorAll("[data-card]")) {
          if (card.dataset.card === next.key) card.focus();
        }
      },
    },
    template: `
      <div class="grid" :style="{ height: total * ${HEIGHT} + 'px' }" @keydown="step">
        <div class="cards" :style="{ top: near.top + 'px', gridTemplateColumns: 'repeat(' + columns + ', 1fr)' }">
          <button v-for="one in near.cards" :key="one.key" type="button" class="card" :data-card="one.key"
            @click="$emit('open', one.key)">
            <span class="thumb"><img :src="one.thumb" alt="" decoding="async"></span>
            <b>{{ one.object }}</b>
            <span class="quiet">{{ one.scene }} · {{ one.lights }}</span>
            <span class="quiet">{{ one.split }} · {{ one.level_name }} · light {{ one.light }}</span>
            <span class="figures"><span>{{ one.key }}</span>
              <span title="relative error">{{ error(one) }}</span>
              <span title="seconds">{{ seconds(one) }}</span></span>
          </button>
        </div>
      </div>`,
  };
})();
