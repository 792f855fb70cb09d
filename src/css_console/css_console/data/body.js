// SPDX-License-Identifier: Apache-2.0
// The spacecraft with what its cells see: drawn when something has moved by a pixel, not sixty times a second.

import { EARTH_AT, SUN_AT, angleOf, drawnBySoftware, inSight } from "./sight.js";
import * as THREE from "./three.module.js";

const CELL_AT = 0.62, VIEW = 0.55;
const DRAW_MS = 100;
const FIELD = (40 * Math.PI) / 180; // of the camera, from bottom to top
const SPOKES = Math.PI / 3; // from one spoke of a wheel to the next
const SOFTWARE_RATIO = 0.75; // pixels for one of the page where a processor draws them
const STEEPEST = (78 * Math.PI) / 180; // half angle of a view beyond which a cone is no picture
const Z = new THREE.Vector3(0, 0, 1);
const dark = matchMedia("(prefers-color-scheme: dark)");

const colour = (name) => new THREE.Color(getComputedStyle(document.documentElement).getPropertyValue(name).trim());
const vector = (v) => new THREE.Vector3(...v);
const turned = (to) => new THREE.Quaternion().setFromUnitVectors(Z, to.clone().normalize());
const rows = (flat) => Array.from({ length: Math.floor((flat ?? []).length / 3) }, (_, i) => flat.slice(3 * i, 3 * i + 3));

export class Body {
  constructor(canvas, complaint, painter) {
    this.canvas = canvas;
    this.software = drawnBySoftware();
    try {
      this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !this.software, alpha: true });
    } catch {
      canvas.hidden = true;
      complaint.hidden = false;
      complaint.textContent = "This browser has no WebGL: the spacecraft is not drawn, everything else works.";
      return;
    }
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera((FIELD * 180) / Math.PI, 1, 0.1, 60);
    this.azimuth = -0.9;
    this.height = 0.45;
    this.distance = 6.4;
    this.view = "space";
    this.group = new THREE.Group();
    this.sky = new THREE.Group();
    this.scene.add(this.group, this.sky, new THREE.AmbientLight(0xffffff, 1.1));
    this.light = new THREE.DirectionalLight(0xffffff, 2.4);
    this.scene.add(this.light);
    this.craft = {};
    this.stale = painter.part(() => this.draw(), DRAW_MS);
    this.inView = true;
    this.build();
    dark.addEventListener("change", () => this.build());
    new ResizeObserver(() => this.stale(true)).observe(canvas);
    new IntersectionObserver(([entry]) => {
      this.inView = entry.isIntersecting;
      if (this.inView) this.stale();
    }).observe(canvas);
    this.listen();
  }

  listen() {
    let held = null;
    this.canvas.addEventListener("pointerdown", (e) => { held = [e.clientX, e.clientY]; this.canvas.setPointerCapture(e.pointerId); });
    this.canvas.addEventListener("pointermove", (e) => {
      if (!held) return;
      this.turn(-(e.clientX - held[0]) * 0.01, (e.clientY - held[1]) * 0.01);
      held = [e.clientX, e.clientY];
    });
    for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, () => { held = null; });
    const keys = { ArrowLeft: [0.12, 0], ArrowRight: [-0.12, 0], ArrowUp: [0, 0.12], ArrowDown: [0, -0.12] };
    this.canvas.addEventListener("keydown", (e) => {
      if (keys[e.key]) this.turn(...keys[e.key]);
      else if (e.key === "+" || e.key === "-") this.zoom(e.key === "+" ? 0.9 : 1.1);
      else return;
      e.preventDefault();
    });
  }

  turn(across, up) {
    this.azimuth += across;
    this.height = Math.min(1.5, Math.max(-1.5, this.height + up));
    this.stale(true);
  }

  zoom(by) {
    this.distance = Math.min(20, Math.max(3, this.distance * by));
    this.stale(true);
  }

  // The spacecraft itself, from its parameters.
  become(craft) {
    if (!this.renderer || JSON.stringify(craft) === JSON.stringify(this.craft)) return;
    this.craft = craft;
    this.build();
  }

  // From where it is seen: `space` or `body`.
  seeFrom(view) {
    this.view = view;
    if (!this.renderer) return;
    this.seen = null;
    this.stale(true);
  }

  build() {
    this.group.clear();
    this.sky.clear();
    const { inertia, array_normal: normal } = this.craft;
    const [x, y, z] = sizes(inertia);
    const metal = new THREE.MeshLambertMaterial({ color: 0x9aa3ad });
    this.group.add(new THREE.Mesh(new THREE.BoxGeometry(x, y, z), metal));
    this.arrays(normal ?? [0, 0, 1], Math.max(x, y, z));
    this.cells = rows(this.craft.normals).map((n, i) => this.cell(vector(n), i));
    this.wheels = (this.craft.wheels_fitted === false ? [] : rows(this.craft.wheel_axes)).map((a) => this.wheel(vector(a)));
    this.trueSun = this.arrow("--sun", false);
    this.estimates = new Map();
    this.earth = new THREE.Mesh(new THREE.SphereGeometry(1, 40, 24), new THREE.MeshLambertMaterial({ color: colour("--earth") }));
    this.sky.add(this.earth);
    this.earth.visible = false;
    this.shades = [colour("--rule"), colour("--lit"), colour("--bad")];
    this.seen = null;
    this.stale(true);
  }

  arrays(normal, reach) {
    const facing = vector(normal).normalize();
    const along = Math.abs(facing.x) < 0.9 ? new THREE.Vector3(1, 0, 0) : new THREE.Vector3(0, 1, 0);
    along.addScaledVector(facing, -along.dot(facing)).normalize();
    const across = new THREE.Vector3().crossVectors(facing, along);
    const basis = new THREE.Matrix4().makeBasis(along, across, facing);
    for (const side of [-1, 1]) {
      const panel = new THREE.Group();
      const front = new THREE.Mesh(new THREE.BoxGeometry(1.0, 0.5, 0.015), new THREE.MeshLambertMaterial({ color: 0x274b8f }));
      const back = new THREE.Mesh(new THREE.BoxGeometry(1.0, 0.5, 0.012), new THREE.MeshLambertMaterial({ color: 0xb9a37a }));
      back.position.z = -0.014;
      panel.add(front, back);
      panel.quaternion.setFromRotationMatrix(basis);
      panel.position.copy(along).multiplyScalar(side * (0.55 * reach + 0.62));
      this.group.add(panel);
    }
  }

  cell(normal, i) {
    const widths = this.craft.fields_of_view_deg ?? [];
    const half = Math.min(((widths[i] ?? this.craft.field_of_view_deg ?? 180) * Math.PI) / 360, STEEPEST);
    const cone = new THREE.Group();
    const length = VIEW * Math.cos(half) + 0.04;
    const open = new THREE.ConeGeometry(length * Math.tan(half), length, 28, 1, true);
    open.translate(0, -length / 2, 0);
    open.rotateX(-Math.PI / 2); // its tip at the cell, open towards +z
    const skin = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.08, side: THREE.DoubleSide, depthWrite: false, forceSinglePass: true });
    const dot = new THREE.Mesh(new THREE.CylinderGeometry(0.06, 0.06, 0.03, 20).rotateX(Math.PI / 2), new THREE.MeshBasicMaterial());
    cone.add(new THREE.Mesh(open, skin), dot, sprite(String(i)));
    cone.children[2].position.z = 0.12;
    cone.quaternion.copy(turned(normal));
    cone.position.copy(normal).normalize().multiplyScalar(CELL_AT);
    this.group.add(cone);
    return { skin, dot: dot.material };
  }

  wheel(axis) {
    const disc = new THREE.Group();
    const rim = new THREE.MeshBasicMaterial({ color: colour("--wheel") });
    disc.add(new THREE.Mesh(new THREE.TorusGeometry(0.13, 0.018, 8, 32), rim));
    for (let i = 0; i < 3; i++) disc.add(new THREE.Mesh(new THREE.BoxGeometry(0.26, 0.012, 0.012).rotateZ((i * Math.PI) / 3), rim));
    disc.position.copy(axis).normalize().multiplyScalar(0.36);
    disc.quaternion.copy(turned(axis));
    this.group.add(disc);
    return { disc, at: disc.quaternion.clone() };
  }

  // A line with a ball at its end, in the body.
  arrow(name, dashed) {
    const line = new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), Z.clone().multiplyScalar(SUN_AT)]);
    const kind = dashed ? new THREE.LineDashedMaterial({ color: colour(name), dashSize: 0.12, gapSize: 0.09 })
      : new THREE.LineBasicMaterial({ color: colour(name) });
    const shaft = new THREE.Line(line, kind);
    shaft.computeLineDistances();
    const end = new THREE.Mesh(new THREE.SphereGeometry(dashed ? 0.06 : 0.14, 20, 14), new THREE.MeshBasicMaterial({ color: colour(name) }));
    end.position.z = SUN_AT;
    const arrow = new THREE.Group();
    arrow.add(shaft, end);
    arrow.visible = false;
    this.group.add(arrow);
    return arrow;
  }

  estimate(name) {
    if (!this.estimates.has(name)) {
      const arrow = this.arrow("--estimate", true);
      const cone = new THREE.Mesh(new THREE.ConeGeometry(1, 1, 40, 1, true).translate(0, -0.5, 0).rotateX(-Math.PI / 2),
        new THREE.MeshBasicMaterial({ color: colour("--estimate"), transparent: true, opacity: 0.28, side: THREE.DoubleSide, depthWrite: false, forceSinglePass: true }));
      arrow.add(cone);
      this.estimates.set(name, { arrow, cone });
    }
    return this.estimates.get(name);
  }

  show(now) {
    this.now = now;
    if (this.renderer && this.inView && this.moved(now)) this.stale();
  }

  // Whether anything is a pixel away from where it was drawn.
  moved(now) {
    const seen = inSight(now, this.view);
    const pixel = (2 * this.distance * Math.tan(FIELD / 2)) / Math.max(this.canvas.clientHeight, 1);
    if (this.seen?.length !== seen.length || seen.some((value, i) => Math.abs(value - this.seen[i]) > pixel)) return true;
    // a wheel that turns on by more than half a spoke looks as if it stood still or turned back
    return (now.wheels_rpm ?? []).some((rpm, i) => {
      const turn = Math.abs(angleOf(rpm, now.time) - this.angles[i]);
      return 0.13 * turn > pixel && turn < SPOKES / 2;
    });
  }

  pose(now) {
    const attitude = new THREE.Quaternion();
    if (now.q_nb && this.view === "space") attitude.set(...now.q_nb);
    this.group.quaternion.copy(attitude);
    this.sky.quaternion.copy(attitude);
    this.showSun(now, attitude);
    this.showCells(now);
    (now.wheels_rpm ?? []).forEach((rpm, i) => this.spin(i, rpm, now.time));
    this.seen = inSight(now, this.view);
    this.angles = (now.wheels_rpm ?? []).map((rpm) => angleOf(rpm, now.time));
  }

  spin(i, rpm, time) {
    const wheel = this.wheels[i];
    wheel?.disc.quaternion.copy(wheel.at).multiply(new THREE.Quaternion().setFromAxisAngle(Z, angleOf(rpm, time)));
  }

  showSun(now, attitude) {
    this.trueSun.visible = Boolean(now.sun);
    if (now.sun) {
      this.trueSun.quaternion.copy(turned(vector(now.sun)));
      this.light.position.copy(vector(now.sun).applyQuaternion(attitude)).multiplyScalar(10);
      this.light.intensity = 0.3 + 2.1 * (now.sunlit ?? 1);
    }
    for (const { arrow } of this.estimates.values()) arrow.visible = false;
    for (const given of now.estimates ?? []) {
      if (!given.sun) continue;
      const { arrow, cone } = this.estimate(given.name);
      arrow.visible = true;
      arrow.quaternion.copy(turned(vector(given.sun)));
      cone.visible = given.bound_deg !== null && given.bound_deg < 80;
      const radius = SUN_AT * Math.tan((Math.min(given.bound_deg ?? 0, 80) * Math.PI) / 180);
      cone.scale.set(radius, radius, SUN_AT);
    }
    this.earth.visible = Boolean(now.earth);
    if (now.earth) {
      this.earth.position.copy(vector(now.earth.b)).multiplyScalar(EARTH_AT);
      // as wide in the sky as it is, but small enough to leave room
      this.earth.scale.setScalar(Math.min(EARTH_AT * Math.sin((now.earth.radius_deg * Math.PI) / 180), 0.42 * EARTH_AT));
    }
  }

  showCells(now) {
    const flies = (now.estimates ?? []).find((e) => e.flies) ?? now.estimates?.[0];
    const [low, high, bad] = this.shades;
    this.cells.forEach(({ skin, dot }, i) => {
      const value = now.cells?.[i];
      const out = flies?.isolated.includes(i) || value === null || value === undefined;
      const level = Math.min(1, Math.max(0, value ?? 0));
      const mixed = out ? bad : low.clone().lerp(high, level);
      dot.color.copy(mixed);
      skin.color.copy(mixed);
      skin.opacity = out ? 0.3 : 0.06 + 0.3 * level;
      skin.wireframe = Boolean(out);
    });
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    if (this.now) this.pose(this.now);
    const ratio = this.software ? SOFTWARE_RATIO : Math.min(devicePixelRatio, 1.5);
    if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
    const size = this.renderer.getSize(new THREE.Vector2());
    if (size.x !== width || size.y !== height) this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    const flat = Math.cos(this.height);
    this.camera.up.copy(Z);
    this.camera.position.set(flat * Math.cos(this.azimuth), flat * Math.sin(this.azimuth), Math.sin(this.height)).multiplyScalar(this.distance);
    this.camera.lookAt(0, 0, 0);
    this.renderer.render(this.scene, this.camera);
    if (!this.software) return;
    // waits for the picture, so that the painter knows what it takes
    const gl = this.renderer.getContext();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }
}

// Edges of a solid block with the ratios of these moments of inertia, the longest 0.8.
function sizes(inertia) {
  const i = inertia?.length === 9 ? [inertia[0], inertia[4], inertia[8]] : [1, 1, 1];
  const total = i[0] + i[1] + i[2];
  const edges = i.map((own) => Math.sqrt(Math.max(total - 2 * own, 0.02 * total)));
  return edges.map((edge) => (0.8 * edge) / Math.max(...edges));
}

function sprite(text) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 64;
  const pen = canvas.getContext("2d");
  pen.font = "bold 40px sans-serif";
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--text").trim();
  pen.fillText(text, 32, 34);
  const label = new THREE.Sprite(new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(canvas), depthTest: false }));
  label.scale.setScalar(0.26);
  return label;
}
