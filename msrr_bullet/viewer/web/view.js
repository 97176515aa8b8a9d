// The 3-D view: meshcat in its pane, the names of the units above their bodies, and its colours by theme.
const data = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const pane = $("meshcat-pane");
const viewer = new MeshCat.Viewer(pane);
const camera = viewer.camera;

function add(parent, tag, text = "", className = "") {
  const element = parent.appendChild(document.createElement(tag));
  element.textContent = text;
  element.className = className;
  return element;
}

viewer.gui.domElement.remove();  // the raw tree of nodes
// Meshcat keeps nodes by name in plain objects, all of which have a "constructor"; a unit may be named so.
const nodes = Object.getPrototypeOf(viewer.scene_tree), findNode = nodes.find;
nodes.find = function find(path) {
  return findNode.call(this, path[0] === "constructor" ? ["constructor ", ...path.slice(1)] : path);
};
// Turn about the position of the camera's node, where three.js would turn about the origin of the world.
const lookAt = camera.lookAt.bind(camera);
camera.lookAt = (target) => lookAt(camera.parent.localToWorld(target.clone()));
// The view holds all bodies in its height; a pane that is hardly wider than high shows as much in its width.
const tangent = Math.tan(0.5 * camera.fov * Math.PI / 180);
// Meshcat takes the height of the window.
const setPaneSize = viewer.set_3d_pane_size.bind(viewer);
function fit() {
  const {clientWidth: width, clientHeight: height} = pane;
  if (!width || !height) return;
  camera.fov = 360 / Math.PI * Math.atan(tangent * Math.max(1, 1.1 * height / width));
  setPaneSize(width, height);
  viewer.set_dirty();
}
viewer.set_3d_pane_size = fit;
new ResizeObserver(fit).observe(pane);

// Keys turn the view about its centre, and zoom. The camera's node has its y axis up.
const TURNS = {a: [-0.1, 0], d: [0.1, 0], w: [0, -0.1], s: [0, 0.1], "+": 1 / 1.1, "-": 1.1};
$("pane").addEventListener("keydown", (event) => {
  const turn = TURNS[event.key.toLowerCase()], p = camera.position;
  if (!turn || event.ctrlKey || event.altKey || event.metaKey) return;
  if (typeof turn === "number") p.multiplyScalar(turn);
  else {
    const r = p.length(), azimuth = Math.atan2(p.x, p.z) + turn[0];
    const polar = Math.min(1.5, Math.max(0.05, Math.acos(p.y / r) + turn[1]));
    p.set(r * Math.sin(polar) * Math.sin(azimuth), r * Math.cos(polar), r * Math.sin(polar) * Math.cos(azimuth));
  }
  viewer.set_dirty();
});

// The name of every unit of a mission stays above it, whichever way the scene is turned.
const names = data.headings.length ? Object.keys(data.colours).map((name) =>
  [add($("pane"), "div", name, "label"), viewer.scene_tree.find(["units", name]).object]) : [];
function label() {
  for (const [element, body] of names) {
    const point = body.position.clone().setZ(0.24);
    body.parent.localToWorld(point).project(camera);
    const x = 0.5 * (1 + point.x) * pane.clientWidth, y = 0.5 * (1 - point.y) * pane.clientHeight;
    element.style.display = point.z < 1 ? "" : "none";
    element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -100%)`;
  }
  requestAnimationFrame(label);
}

// Light and dark: as the system has it, until the button is used.
const systemDark = matchMedia("(prefers-color-scheme: dark)");
const themed = [];  // functions that draw anew in the present theme
// A colour as it is in the present theme.
const inkOf = (colour) => (isDark() && data.inTheDark[colour]) || colour;
const isDark = () => document.documentElement.dataset.theme === "dark";
function setTheme(dark) {
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  data.backgrounds[dark ? 1 : 0].forEach((colour, i) => {
    const rgb = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16) / 255);
    viewer.set_property(["Background"], ["top_color", "bottom_color"][i], rgb);
  });
  viewer.scene.traverse(({material}) => {
    if (!material || !material.color || material.isPointsMaterial) return;
    const own = material.userData.light ||= `#${material.color.getHexString()}`;
    material.color.set(inkOf(own));
  });
  viewer.set_dirty();
  for (const draw of themed) draw();
}
systemDark.addEventListener("change", () => setTheme(systemDark.matches));
$("theme").onclick = () => setTheme(!isDark());
