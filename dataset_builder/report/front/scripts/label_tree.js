// A label, or any JSON, as a tree that folds and can be searched.
"use strict";
const LabelTree = (() => {
  const INLINE = 16; // lists of numbers up to this length stay on one line
  const isPlain = (value) => value === null || typeof value !== "object";
  const isLeaf = (value) => isPlain(value) || !Object.keys(value).length
    || (Array.isArray(value) && value.length <= INLINE && value.every(isPlain));
  const shown = (value) => typeof value === "string" ? value : JSON.stringify(value);

  // Whether a key or value in it contains the words; whose key does is shown whole.
  function holds(name, value, words) {
    if (!words || name.toLowerCase().includes(words)) return true;
    if (isLeaf(value)) return shown(value).toLowerCase().includes(words);
    return Object.entries(value).some(([key, one]) => holds(key, one, words));
  }

  const LabelNode = {
    name: "LabelNode",
    props: { name: String, value: null, words: String, depth: Number },
    data() { return { unfolded: this.depth < 1 }; },
    computed: {
      leaf() { return isLeaf(this.value); },
      below() { return this.name.toLowerCase().includes(this.words) ? "" : this.words; },
      open() { return this.words !== "" || this.unfolded; },
      children() {
        if (this.leaf || !this.open) return [];
        const all = Object.entries(this.value);
        // An entry without branches is read as a whole
        return all.every(([, one]) => isLeaf(one)) ? all : all.filter(([key, one]) => holds(key, one, this.below));
      },
      size() { return Object.keys(this.value).length; },
      text() { return shown(this.value); },
    },
    template: `
      <div v-if="leaf" class="leaf"><span class="key">{{ name }}</span><span class="value">{{ text }}</span></div>
      <details v-else :open="open" @toggle="words || (unfolded = $event.target.open)">
        <summary><span class="key">{{ name }}</span> <span class="count">{{ size }}</span></summary>
        <LabelNode v-for="[key, one] in children" :key="key" :name="key" :value="one" :words="below"
          :depth="depth + 1" />
      </details>`,
  };

  return {
    components: { LabelNode },
    props: { value: Object, title: { type: String, default: "Label" } },
    data() { return { search: "" }; },
    computed: {
      words() { return this.search.trim().toLowerCase(); },
      entries() { return Object.entries(this.value).filter(([key, one]) => holds(key, one, this.words)); },
    },
    template: `
      <section class="label-tree" :aria-label="title">
        <header><h2>{{ title }}</h2><input type="search" v-model="search" placeholder="Search keys and values"
          :aria-label="'Search: ' + title"></header>
        <p v-if="!entries.length" class="quiet">{{ words ? "Nothing matches." : "Empty." }}</p>
        <LabelNode v-for="[key, one] in entries" :key="key" :name="key" :value="one" :words="words" :depth="0" />
      </section>`,
  };
})();
