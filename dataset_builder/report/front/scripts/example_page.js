// A page of one or several examples, whose payloads the page holds.
"use strict";
Vue.createApp({
  components: { LayerView },
  data() {
    const examples = JSON.parse(document.getElementById("examples").textContent);
    return { examples: Vue.markRaw(examples), at: 0 };
  },
  template: `
    <nav v-if="examples.length > 1" class="tabs" aria-label="Examples">
      <button v-for="(one, place) in examples" type="button" :aria-pressed="place === at" @click="at = place">
        {{ one.title }}</button></nav>
    <LayerView v-if="examples.length" :example="examples[at]" />`,
}).mount("#page");
