// The native client's shaders draw what is around the organ: the cloth that it lies on, and the
// edge of an endoscope's picture. The cloth is drawn when the view changes, and kept: in software
// it takes long.

import {
  BufferGeometry,
  GLSL3,
  Mesh,
  NormalBlending,
  RawShaderMaterial,
  Scene,
  Vector2,
  Vector3,
  WebGLRenderTarget,
  type IUniform,
  type PerspectiveCamera,
  type WebGLRenderer,
} from 'three';
import {
  fieldFragmentSource,
  fieldVertexSource,
  lightingSource,
  scopeMaskSource,
} from './gen/shaders';

const kHead = 'precision highp float;\n';
const kFirst = -10,
  kLast = 10; // in the order of drawing

// A triangle over the whole picture; the shader makes its corners.
function whole(
  fragmentShader: string,
  uniforms: Record<string, IUniform>,
  order: number,
): Mesh<BufferGeometry, RawShaderMaterial> {
  const material = new RawShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: fieldVertexSource,
    fragmentShader,
    uniforms,
    depthTest: false,
    depthWrite: false,
  });
  const mesh = new Mesh(new BufferGeometry(), material);
  mesh.geometry.setDrawRange(0, 3);
  mesh.frustumCulled = false;
  mesh.renderOrder = order;
  return mesh;
}

// Copies what was drawn before, pixel by pixel.
const kCopySource = `in vec3 ray;
out vec4 colour;
uniform sampler2D drawn;
uniform vec2 origin, size;
void main() { colour = vec4(texture(drawn, (gl_FragCoord.xy - origin) / size).rgb, 1.0); }
`;

interface Kept {
  target: WebGLRenderTarget;
  view: string;
}

export class Field {
  readonly backdrop: Mesh<BufferGeometry, RawShaderMaterial>;
  readonly scopeEdge: Mesh<BufferGeometry, RawShaderMaterial>;
  private readonly own = {
    forward: { value: new Vector3() },
    right: { value: new Vector3() },
    up: { value: new Vector3() },
    organ_centre: { value: new Vector3() },
    organ_size: { value: new Vector3(1, 1, 1) },
  };
  private readonly aspect = { value: 1 };
  private readonly copied = {
    drawn: { value: null as WebGLRenderTarget['texture'] | null },
    origin: { value: new Vector2() },
    size: { value: new Vector2(1, 1) },
  };
  private readonly scene = new Scene();
  private readonly kept = new Map<number, Kept>(); // by view

  // `lights`: the uniforms of the lamps and the eye.
  constructor(lights: Record<string, IUniform>) {
    this.scene.add(
      whole(kHead + lightingSource + fieldFragmentSource, { ...lights, ...this.own }, kFirst),
    );
    const still = {
      forward: { value: new Vector3() },
      right: { value: new Vector3() },
      up: { value: new Vector3() },
    };
    this.backdrop = whole(kHead + kCopySource, { ...still, ...this.copied }, kFirst);
    const across = {
      forward: { value: new Vector3() },
      right: { value: new Vector3(1, 0, 0) },
      up: { value: new Vector3(0, 1, 0) },
    };
    this.scopeEdge = whole(kHead + scopeMaskSource, { ...across, aspect: this.aspect }, kLast);
    Object.assign(this.scopeEdge.material, { transparent: true, blending: NormalBlending });
  }

  // The cloth lies where the organ was lowest before anybody touched it; corners of its box, m.
  measure(low: Vector3, high: Vector3): void {
    const extent = high.clone().sub(low);
    this.own.organ_centre.value.set(
      (low.x + high.x) / 2,
      low.y - 0.1 * extent.y,
      (low.z + high.z) / 2,
    );
    this.own.organ_size.value.copy(extent).multiplyScalar(0.5);
  }
  // Before the view is drawn; `box`: its left, bottom, width and height in pixels of the canvas.
  look(
    renderer: WebGLRenderer,
    view: number,
    camera: PerspectiveCamera,
    isEndoscope: boolean,
    box: readonly [number, number, number, number],
  ): void {
    const m = camera.matrixWorld.elements,
      half = Math.tan((camera.fov * Math.PI) / 360);
    this.own.right.value.set(m[0], m[1], m[2]).multiplyScalar(half * camera.aspect);
    this.own.up.value.set(m[4], m[5], m[6]).multiplyScalar(half);
    this.own.forward.value.set(-m[8], -m[9], -m[10]);
    this.aspect.value = camera.aspect;
    this.scopeEdge.visible = isEndoscope;
    const ratio = renderer.getPixelRatio(),
      width = Math.max(1, Math.round(box[2] * ratio)),
      height = Math.max(1, Math.round(box[3] * ratio));
    const what = [
      ...m,
      camera.fov,
      camera.aspect,
      width,
      height,
      ...this.own.organ_centre.value.toArray(),
      ...this.own.organ_size.value.toArray(),
    ].join();
    let kept = this.kept.get(view);
    if (!kept) {
      kept = { target: new WebGLRenderTarget(width, height, { depthBuffer: false }), view: '' };
      this.kept.set(view, kept);
    }
    if (kept.view !== what) {
      kept.view = what;
      kept.target.setSize(width, height);
      const tested = renderer.getScissorTest();
      renderer.setScissorTest(false);
      renderer.setRenderTarget(kept.target);
      renderer.render(this.scene, camera);
      renderer.setRenderTarget(null);
      renderer.setScissorTest(tested);
    }
    this.copied.drawn.value = kept.target.texture;
    this.copied.origin.value.set(box[0] * ratio, box[1] * ratio);
    this.copied.size.value.set(width, height);
  }
  dispose(): void {
    for (const { target } of this.kept.values()) target.dispose();
  }
}
