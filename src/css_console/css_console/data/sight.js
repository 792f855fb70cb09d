// SPDX-License-Identifier: Apache-2.0
// What of an instant is seen in the picture of the spacecraft, and what draws it.

export const SUN_AT = 2.6, EARTH_AT = 7.0; // lengths in the scene
const SHADE = 0.6; // length that a cell counts as from dark to lit
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;

// Whether a processor draws in place of a graphics processor.
export function drawnBySoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE.test(name);
}

// Angle by which a wheel is shown turned, at a hundredth of the true rate: of the true one the eye would see nothing.
export function angleOf(rpm, time) {
  return ((rpm * time * Math.PI) / 30) * 0.01;
}

// What of an instant the eye sees, as lengths in the scene; lengths that differ by more than a pixel are another picture.
export function inSight(now, view) {
  const flies = (now.estimates ?? []).find((e) => e.flies) ?? now.estimates?.[0];
  const scaled = (vector, by) => (vector ?? [9, 9, 9]).map((value) => by * value);
  return [
    ...(view === "space" ? scaled(now.q_nb, 2 * SUN_AT) : []),
    ...scaled(now.sun, SUN_AT), SHADE * (now.sunlit ?? 1),
    ...scaled(now.earth?.b, EARTH_AT),
    ...(now.estimates ?? []).flatMap((e) => [...scaled(e.sun, SUN_AT), (SUN_AT * Math.min(e.bound_deg ?? 90, 90) * Math.PI) / 180]),
    ...(now.cells ?? []).map((value, i) => (value === null || flies?.isolated.includes(i) ? 9 : SHADE * value)),
  ];
}
