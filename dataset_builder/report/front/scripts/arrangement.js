// An arrangement in three dimensions: things that can be hidden and picked, lamps, the camera's view, names.
"use strict";
const Arrangement = (() => {
  const STEPS = 65535, PANE = 0.25, NEAR = 0.01; // the last: share of the distance to what is looked at
  const LINEAR = Uint16Array.from({ length: 256 }, (_, code) => {
    const value = code / 255;
    return Math.round(65535 * (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4));
  });
  const point = (values, at = 0) => new THREE.Vector3(values[at], values[at + 1], values[at + 2]);

  // The opaque or the clear triangles of a thing, three corners each.
  function geometry(thing, buffer, clear) {
    const count = thing.triangles, faces = new Uint32Array(buffer, 0, 3 * count);
    const steps = new Uint16Array(buffer, 12 * count, 3 * thing.vertices);
    const colours = new Uint8Array(buffer, 12 * count + 6 * thing.vertices, 3 * count);
    const panes = new Uint8Array(buffer, 15 * count + 6 * thing.vertices, count);
    const kept = panes.reduce((sum, pane) => sum + (pane === clear), 0);
    const places = new Float32Array(9 * kept), shades = new Uint16Array(9 * kept);
    for (let face = 0, to = 0; face < count; face++) {
      if (panes[face] !== clear) continue;
      for (let corner = 0; corner < 3; corner++) {
        for (let axis = 0; axis < 3; axis++, to++) {
          places[to] = thing.low[axis] + thing.side[axis] * steps[3 * faces[3 * face + corner] + axis] / STEPS;
          shades[to] = LINEAR[colours[3 * face + axis]];
        }
      }
    }
    const made = new THREE.BufferGeometry();
    made.setAttribute("position", new THREE.BufferAttribute(places, 3));
    made.setAttribute("color", new THREE.BufferAttribute(shades, 3, true));
    return kept ? made : null;
  }

  function lines(values, colour, onTop) {
    const made = new THREE.BufferGeometry();
    made.setAttribute("position", new THREE.Float32BufferAttribute(values, 3));
    const shown = new THREE.LineSegments(made, new THREE.LineBasicMaterial({ color: colour, depthTest: !onTop }));
    shown.renderOrder = onTop ? 1 : 0;
    return shown;
  }

  class Scene {
    // box: element that is drawn in; picked: called with the name and rows of what was clicked; left: called when the
    // viewer leaves the camera. Throws where the browser has no WebGL.
    constructor(box, data, picked, left) {
      Object.assign(this, { box, data, picked, left, through: false, cut: true, hidden: new Set(), groups: {} });
      this.renderer = new THREE.WebGLRenderer({ antialias: true });
      this.renderer.localClippingEnabled = true;
      this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
      box.append(this.renderer.domElement);
      this.scene = new THREE.Scene();
      this.scene.background = new THREE.Color("#ffffff");
      this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8580, 2.2));
      this.lamp = new THREE.DirectionalLight(0xffffff, 1.1);
      this.scene.add(this.lamp, this.lamp.target);
      this.viewer = new THREE.PerspectiveCamera(data.eye.fov);
      this.viewer.up.set(0, 0, 1);
      this.controls = new THREE.OrbitControls(this.viewer, this.renderer.domElement);
      this.controls.zoomToCursor = true;
      this.controls.addEventListener("start", () => this.leave());
      this.controls.addEventListener("change", () => this.draw());
      this.roof = new THREE.Plane(new THREE.Vector3(0, 0, -1), Infinity);
      this.near = new THREE.Plane();
      this.centre = point(data.target.centre);
      this.names = new NameTags(box);
      for (const part of ["target", "furniture", "walls", "ceiling", "floor", "lights", "camera"]) {
        this.groups[part] = new THREE.Group();
        this.scene.add(this.groups[part]);
      }
      this.addLights();
      this.addCamera();
      this.groups.target.add(lines(data.target.lines, data.target.colour, true));
      this.overview();
      new ResizeObserver(() => this.resize()).observe(box);
      this.listen();
    }

    async load() {
      for (const thing of this.data.things) {
        const buffer = await Layers.inflated(thing.data);
        for (const clear of [0, 1]) {
          const made = geometry(thing, buffer, clear);
          if (!made) continue;
          const mesh = new THREE.Mesh(made, this.material(thing.part, clear));
          mesh.userData = thing;
          this.groups[thing.part].add(mesh);
        }
        const top = new THREE.Vector3(thing.low[0] + thing.side[0] / 2, thing.low[1] + thing.side[1] / 2,
          thing.low[2] + thing.side[2]);
        if (thing.part === "target") this.names.add(thing.name, top, "target", this.data.target.colour, 0);
        if (thing.part === "furniture") this.names.add(thing.category, top, "furniture", "#222", 3 + thing.away);
      }
      this.draw();
    }

    material(part, clear) {
      return new THREE.MeshLambertMaterial({ vertexColors: true, flatShading: true, side: THREE.DoubleSide,
        transparent: !!clear, opacity: clear ? PANE : 1, depthWrite: !clear,
        clippingPlanes: part === "walls" ? [this.roof, this.near] : [this.roof] });
    }

    addLights() {
      for (const light of this.data.lights) {
        const made = new THREE.BufferGeometry();
        made.setAttribute("position", new THREE.Float32BufferAttribute(light.positions, 3));
        made.setIndex(light.faces);
        const look = new THREE.MeshBasicMaterial({ color: light.colour, side: THREE.DoubleSide });
        const mesh = new THREE.Mesh(made, look);
        mesh.userData = light;
        if (light.faces.length) this.groups.lights.add(mesh);
        if (light.lines.length) this.groups.lights.add(lines(light.lines, light.colour, false));
        this.names.add(light.label, point(light.at), "lights", light.colour, 2);
      }
    }

    addCamera() {
      const camera = this.data.camera;
      if (!camera) return;
      this.groups.camera.add(lines(camera.lines, camera.colour, true));
      this.names.add(camera.label, point(camera.position), "camera", camera.colour, 1);
    }

    overview() {
      const eye = this.data.eye;
      this.through = false;
      this.viewer.fov = eye.fov;
      this.viewer.position.copy(point(eye.position));
      this.controls.target.copy(point(eye.target));
      this.controls.update();
      this.resize();
    }

    // See what the example's camera sees, its whole picture within the frame.
    lookThrough() {
      const camera = this.data.camera;
      this.through = true;
      this.viewer.up.copy(point(camera.up));
      this.viewer.position.copy(point(camera.position));
      this.viewer.lookAt(point(camera.target));
      this.viewer.up.set(0, 0, 1);
      this.controls.target.copy(point(camera.target));
      this.resize();
    }

    leave() {
      if (!this.through) return;
      this.through = false;
      this.viewer.fov = this.data.eye.fov;
      this.viewer.updateProjectionMatrix();
      this.left();
    }

    // Style of the example's picture within the stage, of any size, while the viewer looks through its camera.
    frame() {
      const { width, height } = this.data.camera;
      return { width: `min(100cqw, ${width / height} * 100cqh)`, aspectRatio: `${width} / ${height}` };
    }

    resize() {
      const { clientWidth: width, clientHeight: height } = this.box;
      if (!width || !height) return;
      this.renderer.setSize(width, height);
      this.viewer.aspect = width / height;
      if (this.through) {
        const camera = this.data.camera, half = Math.tan(camera.fov * Math.PI / 360);
        const rise = half * Math.max(camera.height / camera.width, height / width);
        this.viewer.fov = Math.atan(rise) * 360 / Math.PI;
      }
      this.viewer.updateProjectionMatrix();
      this.draw();
    }

    toggle(part, shown) {
      this.hidden[shown ? "delete" : "add"](part);
      this.draw();
    }

    // What is not there in the picture is not there through the camera, either.
    visible(part, object) {
      return !this.hidden.has(part) && !(this.through && (object.isLine || object.userData.of === "source"));
    }

    // Cut away what is above the room and the walls on the viewer's side, unless it looks through the camera.
    place() {
      const cut = this.cut && !this.through, away = this.viewer.position.clone().sub(this.centre).setZ(0);
      const above = this.data.roof !== null && this.viewer.position.z > this.data.roof;
      this.roof.constant = cut && above ? this.data.roof : 1e9;
      this.near.setFromNormalAndCoplanarPoint(away.normalize().negate(), this.centre);
      if (!cut) this.near.constant = 1e9;
      for (const [name, group] of Object.entries(this.groups)) {
        for (const child of group.children) child.visible = this.visible(name, child);
      }
      this.lamp.position.copy(this.viewer.position);
      this.lamp.target.position.copy(this.controls.target);
    }

    // Depths that are drawn: near enough to what is looked at, however small, and all of it, however large.
    depths() {
      const at = this.viewer.position, { low, high } = this.data.reach;
      const middle = point(low).add(point(high)).divideScalar(2);
      this.viewer.far = 1.1 * (at.distanceTo(middle) + point(low).distanceTo(point(high)) / 2);
      this.viewer.near = Math.min(at.distanceTo(this.centre), at.distanceTo(this.controls.target)) * NEAR;
      this.viewer.near = Math.max(this.viewer.near, this.viewer.far * 1e-7);
      this.viewer.updateProjectionMatrix();
    }

    draw() {
      this.place();
      this.depths();
      this.renderer.render(this.scene, this.viewer);
      this.names.draw(this.viewer, (part) => !this.through && !this.hidden.has("names") && !this.hidden.has(part));
    }

    listen() {
      const canvas = this.renderer.domElement;
      let from = null;
      canvas.addEventListener("pointerdown", (event) => { from = [event.clientX, event.clientY]; });
      canvas.addEventListener("pointerup", (event) => {
        if (from && Math.hypot(event.clientX - from[0], event.clientY - from[1]) < 4) this.pick(event);
      });
    }

    pick(event) {
      const box = this.renderer.domElement.getBoundingClientRect();
      const x = (event.clientX - box.left) / box.width, y = (event.clientY - box.top) / box.height;
      const ray = new THREE.Raycaster();
      ray.setFromCamera(new THREE.Vector2(2 * x - 1, 1 - 2 * y), this.viewer);
      const meshes = Object.values(this.groups).flatMap((group) => group.children)
        .filter((child) => child.isMesh && child.visible);
      const hit = ray.intersectObjects(meshes, false).find(({ object, point: place }) =>
        (object.material.clippingPlanes ?? []).every((plane) => plane.distanceToPoint(place) >= 0));
      this.picked(hit ? hit.object.userData : null);
    }
  }
  return { Scene };
})();
