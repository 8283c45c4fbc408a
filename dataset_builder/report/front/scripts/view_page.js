// The page of `dataset-builder view`: the arrangement of an example, why it is as it is, and a preview.
"use strict";
const FactRows = {
  props: { rows: Array },
  template: `<dl class="facts"><template v-for="[name, value] in rows" :key="name"><dt>{{ name }}</dt>
    <dd>{{ value }}</dd></template></dl>`,
};
Vue.createApp({
  components: { LayerView, LabelTree, FactRows },
  data() {
    const page = Vue.markRaw(JSON.parse(document.getElementById("view").textContent));
    const shown = { furniture: true, walls: true, ceiling: true, floor: true, lights: true, camera: true, names: true };
    return { page, shown, cut: true, through: false, picked: null, frame: {}, trouble: "" };
  },
  computed: {
    things() { return this.page.arrangement.things; },
    lights() { return this.page.arrangement.lights; },
    camera() { return this.page.arrangement.camera; },
    triangles() { return this.things.reduce((sum, thing) => sum + thing.triangles, 0).toLocaleString("en"); },
  },
  async mounted() {
    try {
      this.scene = Vue.markRaw(new Arrangement.Scene(this.$refs.stage, this.page.arrangement,
        (picked) => { this.picked = picked; }, () => { this.through = false; }));
      await this.scene.load();
      this.$refs.stage.dataset.ready = "yes";
    } catch (error) {
      this.trouble = `This browser cannot draw it in three dimensions (${error.message}); view.png shows it, too.`;
    }
    window.arrangementScene = this.scene;
  },
  methods: {
    toggle(part) { this.scene?.toggle(part, this.shown[part]); },
    cutAway() {
      if (!this.scene) return;
      this.scene.cut = this.cut;
      this.scene.draw();
    },
    look(through) {
      if (!this.scene) return;
      this.through = through;
      if (through) this.scene.lookThrough(); else this.scene.overview();
      this.frame = through ? this.scene.frame() : {};
    },
  },
  template: `
    <article class="view-page">
      <header class="head"><div class="title"><h1>{{ page.title }}</h1>
        <span v-if="page.badge" class="badge">{{ page.badge }}</span></div>
        <p class="quiet">{{ page.said }} <span class="dot">·</span> {{ triangles }} triangles</p></header>
      <p v-for="text in page.problems" class="trouble" role="alert">{{ text }}</p>
      <div class="tools" role="toolbar" aria-label="Arrangement">
        <span class="choice" role="group" aria-label="Viewer">
          <button type="button" :aria-pressed="!through" @click="look(false)">From above</button>
          <button v-if="camera" type="button" :aria-pressed="through" @click="look(true)">Through the camera</button>
        </span>
        <label v-for="(_, part) in shown"><input type="checkbox" v-model="shown[part]" @change="toggle(part)">
          {{ part }}</label>
        <label title="Walls on your side and what is above"><input type="checkbox" v-model="cut" @change="cutAway">
          cut away</label>
      </div>
      <p v-if="trouble" class="trouble" role="alert">{{ trouble }}</p>
      <div class="columns">
        <div class="stage" ref="stage"><i v-if="through" class="picture-frame" :style="frame"></i></div>
        <aside class="side">
          <section v-if="picked"><h2>{{ picked.name }}</h2><FactRows :rows="picked.rows" /></section>
          <p v-else class="quiet">Drag to turn, scroll to come closer, click a thing to see what it is.</p>
          <section v-if="camera"><h2>Camera</h2><FactRows :rows="camera.rows" /></section>
          <details v-for="light in lights" :open="light.of === 'target'"><summary><i class="dot-of"
            :style="{ background: light.colour }"></i>{{ light.name }}</summary>
            <FactRows :rows="light.rows" /></details>
          <details><summary>{{ things.length }} things</summary>
            <button v-for="thing in things" type="button" class="thing" @click="picked = thing">
              {{ thing.name }}</button>
          </details>
        </aside>
      </div>
      <p v-if="page.unseen" class="lead">{{ page.unseen }}</p>
    </article>
    <LayerView v-if="page.preview" :example="page.preview" />
    <article class="view-page">
      <section v-if="page.decisions.length" class="decisions"><h2>What is simulated, and why</h2>
        <table><tr><th>effect</th><th>choice</th><th>why</th></tr>
          <tr v-for="row in page.decisions"><td v-for="cell in row">{{ cell }}</td></tr></table></section>
      <section v-if="!page.preview && page.plan" class="plan"><h2>The whole plan</h2>
        <LabelTree :value="page.plan" /></section>
    </article>`,
}).mount("#page");
