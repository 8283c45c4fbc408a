// The global `THREE` of pages: the library and its orbit controls.
export * from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
