/** Fruits as points that a shader lights as spheres: 50,000 of them draw in one call, without a triangle. */
import { Geometry, Mesh, Program, type OGLRenderingContext } from "ogl";

/** In the fourth byte of a colour. */
export const LOOKS = { hidden: 0, faded: 85, ring: 170, solid: 255 } as const;

const VERTEX = `#version 300 es
in vec3 position;
in float diameter;
in vec4 colour;
uniform mat4 modelViewMatrix, projectionMatrix;
uniform float pixels, least;
out vec3 tint;
flat out float look, rim;
void main() {
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  gl_PointSize = max(pixels * diameter / gl_Position.w, least);
  tint = colour.rgb;
  look = colour.a;
  rim = 1.0 - 3.0 / gl_PointSize;
  if (look < 0.1) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
}`;

const FRAGMENT = `#version 300 es
precision mediump float;
in vec3 tint;
flat in float look, rim;
uniform vec3 background;
out vec4 shown;
void main() {
  vec2 at = 2.0 * gl_PointCoord - 1.0;
  float r2 = dot(at, at);
  if (r2 > 1.0 || (look > 0.5 && look < 0.8 && r2 < 0.4)) discard;
  vec3 normal = vec3(at.x, -at.y, sqrt(1.0 - r2));
  float light = 0.62 + 0.42 * dot(normal, vec3(-0.38, 0.56, 0.73));
  float shine = 0.22 * pow(max(dot(normal, vec3(-0.25, 0.42, 0.87)), 0.0), 24.0);
  vec3 lit = look > 0.8 ? tint * light + shine : tint;
  // The rim fades where it has two pixels for it: most fruits hang before nothing.
  float solid = rim > 0.3 && look > 0.8 ? 1.0 - smoothstep(rim, 1.0, sqrt(r2)) * 0.7 : 1.0;
  shown = vec4(look < 0.5 ? mix(background, tint, 0.28) : mix(background, lit, solid), 1.0);
}`;

export interface Spheres {
  readonly mesh: Mesh;
  readonly positions: Float32Array;
  readonly diameters: Float32Array;
  readonly colours: Uint8Array;
  /** Says that the three arrays have changed. */
  readonly changed: () => void;
  readonly setPixels: (pixelsOfMetreAtOneMetre: number, leastPx: number) => void;
  readonly setBackground: (rgb: readonly number[]) => void;
}

export function spheres(gl: OGLRenderingContext, n: number): Spheres {
  const positions = new Float32Array(3 * n);
  const diameters = new Float32Array(n);
  const colours = new Uint8Array(4 * n);
  const geometry = new Geometry(gl, {
    position: { size: 3, data: positions, usage: gl.DYNAMIC_DRAW },
    diameter: { size: 1, data: diameters, usage: gl.DYNAMIC_DRAW },
    colour: { size: 4, data: colours, type: gl.UNSIGNED_BYTE, normalized: true, usage: gl.DYNAMIC_DRAW },
  });
  const uniforms = { pixels: { value: 1 }, least: { value: 2 }, background: { value: [1, 1, 1] } };
  const program = new Program(gl, { vertex: VERTEX, fragment: FRAGMENT, uniforms });
  const mesh = new Mesh(gl, { mode: gl.POINTS, geometry, program, frustumCulled: false });
  return {
    mesh,
    positions,
    diameters,
    colours,
    changed: () => {
      for (const attribute of Object.values(geometry.attributes)) attribute.needsUpdate = true;
    },
    setPixels: (pixels, least) => {
      uniforms.pixels.value = pixels;
      uniforms.least.value = least;
    },
    setBackground: (rgb) => {
      uniforms.background.value = [...rgb];
    },
  };
}
