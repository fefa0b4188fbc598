// The picture: geometry of the module, drawn with the native client's shaders.

import {
  BackSide,
  BufferAttribute,
  BufferGeometry,
  Data3DTexture,
  DynamicDrawUsage,
  GLSL3,
  LinearFilter,
  Matrix4,
  Mesh,
  MOUSE,
  RawShaderMaterial,
  Raycaster,
  RepeatWrapping,
  Scene,
  TOUCH,
  Vector2,
  Vector3,
  Vector4,
  WebGLRenderer,
  type Intersection,
  type IUniform,
  type PerspectiveCamera,
} from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import {
  backFragmentSource,
  lightingSource,
  organFragmentSource,
  organVertexSource,
} from './gen/shaders';
import { Field } from './field';
import { FineLayer } from './fine';
import { Instruments, kShadows, type Guide } from './instruments';
import { Pane, partsOf, type Part, type ViewCount } from './pane';
import { Overlay, type Rays, type Replica, type Tool, type Vec3 } from './replica';

// A place of the surface: shares of the corners of a triangle, which are numbers of vertices.
export interface SurfacePlace {
  corners: Vec3;
  shares: Vec3;
}
const kPattern = 64;
const kScopeLamp = 0.07;
const kHazePerMiddle = 0.55,
  kScopeHaze: [number, number] = [0.05, 4]; // the native picture's
const kPitch = 0.42; // views begin at the front, a side, the back, and above
const kStarts: [number, number][] = [
  [0, kPitch],
  [Math.PI / 2, kPitch],
  [Math.PI, kPitch],
  [0, 1.45],
];
const kSlowMs = 45,
  kJudged = 40; // pictures, before quality is lowered

export class Picture {
  overlay: Overlay = Overlay.Regions;
  showsArrows = true;
  // The person moves a view, so that it follows nobody.
  onLetGo: (view: number) => void = () => undefined;
  onTurn: () => void = () => undefined; // the person moves the first view, whatever it follows
  onActive: (view: number) => void = () => undefined; // another one is moved from now on
  // The session's tools, with one's own where the hand has them now.
  asHeld: (tools: Tool[]) => Tool[] = tools => tools;
  pictures = 0;
  drawMs = 0; // the last picture took so long
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly controls: OrbitControls;
  private readonly panes = kStarts.map(([yaw, pitch]) => new Pane(yaw, pitch));
  private count: ViewCount = 1;
  private active = 0; // the view that mouse and keys move
  // Its outside, and what a blade has laid open.
  private readonly organ: Mesh<BufferGeometry, [RawShaderMaterial, RawShaderMaterial]>;
  private readonly backs: Mesh<BufferGeometry, RawShaderMaterial>;
  private readonly fine: FineLayer;
  private readonly field: Field;
  private readonly uniforms: Record<string, IUniform>;
  private readonly looks: Side[]; // of the outside and the inside
  private readonly instruments: Instruments;
  private version = -1;
  private lastMs = 0;
  private gaps: number[] = [];
  private quality: number; // 0 best, 1 plain, 2 fewer pixels
  private width = 1;
  private height = 1;

  constructor(
    readonly canvas: HTMLCanvasElement,
    labels: HTMLElement,
    private readonly replica: Replica,
    private readonly guide: Guide,
  ) {
    const gl = canvas.getContext('webgl2', {
      antialias: !isSlow(),
      alpha: true,
      powerPreference: 'high-performance',
    });
    if (!gl) throw new Error('This browser cannot draw here: it has no WebGL 2.');
    this.quality = rendersInSoftware(gl) ? 1 : 0;
    this.renderer = new WebGLRenderer({ canvas, context: gl });
    this.renderer.setClearColor(0, 0);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.zoomToCursor = true;
    this.controls.minDistance = 0.01;
    this.controls.maxDistance = 2.5;
    this.controls.target = this.main.target;
    this.controls.addEventListener('start', () => {
      if (this.active === 0) this.onTurn();
      this.letGo();
    });
    // Before the controls: they move the view that was touched.
    for (const kind of ['pointerdown', 'wheel'] as const)
      canvas.addEventListener(kind, this.touch, true);
    const four = (): Vector4[] => Array.from({ length: kShadows }, () => new Vector4());
    this.uniforms = {
      clip_from_world: { value: new Matrix4() },
      eye: { value: new Vector3() },
      key_direction: { value: new Vector3(0, 1, 0) },
      fill_direction: { value: new Vector3(0, 1, 0) },
      lamp: { value: 0 },
      haze: { value: new Vector2() },
      shadow_count: { value: 0 },
      shadow_tip: { value: four() },
      shadow_shaft: { value: four() },
    };
    const side = (isInside: boolean): Side => ({
      ...this.uniforms,
      noise: { value: patternOf(replica, isInside) },
      part_dark: { value: new Float32Array(12) },
      part_light: { value: new Float32Array(12) },
      lines: { value: new Float32Array(4) },
      figures: { value: new Float32Array(4) },
    });
    const outside = side(false),
      inside = side(true);
    this.looks = [outside, inside];
    const material = (uniforms: Record<string, IUniform>): RawShaderMaterial =>
      new RawShaderMaterial({ glslVersion: GLSL3, vertexShader: organVertexSource, uniforms });
    this.organ = new Mesh(new BufferGeometry(), [material(outside), material(inside)]);
    this.backs = new Mesh(this.organ.geometry, material(outside));
    this.backs.material.side = BackSide;
    this.organ.frustumCulled = this.backs.frustumCulled = false;
    this.fine = new FineLayer(outside);
    this.field = new Field(this.uniforms);
    this.instruments = new Instruments(
      this.scene,
      this.uniforms,
      labels,
      replica,
      guide,
      this.main,
      at => this.onCanvas(at),
    );
    this.scene.add(
      this.organ,
      this.backs,
      this.fine.mesh,
      this.field.backdrop,
      this.field.scopeEdge,
    );
    this.setQuality(this.quality);
  }

  get isPlain(): boolean {
    return this.quality > 0;
  }
  // One line for people: why the fine surface, or its picture, is not drawn; empty: nothing is
  // wrong.
  get fineFault(): string {
    return this.replica.fineFault || this.fine.fault;
  }
  get views(): ViewCount {
    return this.count;
  }
  get parts(): Part[] {
    return this.panes.slice(0, this.count).map(pane => pane.part);
  }
  // How many views there are; the first is always there.
  set views(count: ViewCount) {
    this.count = count;
    if (this.active >= count) this.activate(0);
    this.resize(this.width, this.height);
  }
  // Mouse and keys move that view.
  activate(view: number): void {
    if (view >= this.count) return;
    this.active = view;
    this.controls.object = this.moved.camera;
    this.controls.target = this.moved.target;
    this.onActive(view);
  }
  // Whom a view follows; null: nobody. `isAlong`: it looks along that one's tool.
  follow(view: number, participant: number | null, isAlong = false): void {
    Object.assign(this.panes[view] ?? {}, { follows: participant, isAlong });
  }
  // A view sees with the tool in a slot, as long as it is there; null: from its own place.
  seeWith(view: number, slot: number | null): void {
    Object.assign(this.panes[view] ?? {}, { seesWith: slot });
  }
  // Sets the view as it was at the beginning.
  resetView(): void {
    this.letGo();
    this.moved.isFramed = false;
  }
  turn(yaw: number, pitch: number): void {
    this.letGo();
    this.moved.turn(yaw, pitch);
  }
  zoom(factor: number): void {
    this.letGo();
    this.moved.zoom(factor);
  }
  private letGo(): void {
    if (this.moved.follows === null && this.moved.seesWith === null) return;
    Object.assign(this.moved, { follows: null, seesWith: null });
    this.onLetGo(this.active);
  }
  // Where the first view is, m: for others, who follow it.
  view(): { eye: Vec3; target: Vec3 } {
    const { x, y, z } = this.camera.position,
      to = this.main.target;
    return { eye: [x, y, z], target: [to.x, to.y, to.z] };
  }
  look(eye: Vec3, target: Vec3): void {
    this.main.isFramed = true;
    this.camera.position.set(...eye);
    this.main.target.set(...target);
  }
  // Where each view looks from, m.
  places(): Vec3[] {
    return this.panes.slice(0, this.count).map(({ camera: { position: p } }) => [p.x, p.y, p.z]);
  }
  private get main(): Pane {
    return this.panes[0]!;
  }
  private get moved(): Pane {
    return this.panes[this.active] ?? this.main;
  }
  private get camera(): PerspectiveCamera {
    return this.main.camera;
  }
  private readonly touch = (event: MouseEvent): void => {
    const rect = this.canvas.getBoundingClientRect(),
      x = (event.clientX - rect.left) / rect.width,
      y = (event.clientY - rect.top) / rect.height;
    const view = this.panes.findIndex((pane, i) => i < this.count && pane.has(x, y));
    if (view >= 0 && view !== this.active) this.activate(view);
  };
  dispose(): void {
    for (const kind of ['pointerdown', 'wheel'] as const)
      this.canvas.removeEventListener(kind, this.touch, true);
    this.controls.dispose();
    this.field.dispose();
    this.fine.dispose();
    this.renderer.dispose();
    this.instruments.dispose();
  }

  resize(width: number, height: number): void {
    this.width = Math.max(1, width);
    this.height = Math.max(1, height);
    const ratio =
      Math.min(2, window.devicePixelRatio || 1) *
      (this.quality === 2
        ? 0.6
        : this.quality === 1
          ? Math.min(1, 1 / (window.devicePixelRatio || 1))
          : 1);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(this.width, this.height, false);
    partsOf(this.count, this.height > this.width).forEach((part, i) => {
      const pane = this.panes[i]!;
      pane.part = part;
      pane.camera.aspect = (this.width * part[2]) / (this.height * part[3]);
      pane.camera.updateProjectionMatrix();
    });
  }

  // Draws this moment; false while there is nothing to draw.
  draw(nowMs: number): boolean {
    const begin = performance.now();
    const seconds = Math.min(0.25, Math.max(0.001, (nowMs - this.lastMs) / 1000));
    if (!this.replica.update(nowMs, [100_000, 16_000, 8_000][this.quality] ?? 8_000, this.overlay))
      return false;
    this.judge(nowMs - this.lastMs);
    this.lastMs = nowMs;
    if (this.replica.geometryVersion !== this.version) this.loadGeometry();
    this.loadPositions();
    const tools = this.asHeld(this.replica.tools()),
      shown = this.panes.slice(0, this.count);
    for (const pane of shown) {
      if (!pane.isFramed) this.frame(pane);
      pane.follow(tools, seconds);
      pane.camera.lookAt(pane.target);
      const lender = tools.find(tool => tool.slot === pane.seesWith);
      pane.lookThrough(
        lender ? this.replica.lens(lender.slot, this.guide.shapeOf(lender.slot)) : null,
      );
    }
    this.controls.update();
    for (const pane of shown) pane.keepClear(this.replica);
    this.instruments.place(tools, seconds, this.showsArrows);
    this.fine.load(this.replica);
    // The fine surface takes the place of the outside.
    this.organ.geometry.setDrawRange(
      this.fine.isShown ? this.replica.outerTriangles * 3 : 0,
      Infinity,
    );
    this.renderer.setScissorTest(this.count > 1);
    for (const [view, pane] of shown.entries()) {
      const [left, top, width, height] = pane.part;
      const box = [
        left * this.width,
        (1 - top - height) * this.height,
        width * this.width,
        height * this.height,
      ] as const;
      this.renderer.setViewport(...box);
      this.renderer.setScissor(...box);
      this.light(pane);
      this.field.look(this.renderer, view, pane.drawn, pane.isEndoscope, box);
      // An endoscope is not in its own picture.
      const own = pane.isEndoscope ? this.instruments.groupOf(pane.seesWith) : undefined;
      if (own) own.visible = false;
      this.renderer.render(this.scene, pane.drawn);
      if (own) own.visible = true;
    }
    this.instruments.placeLabels(tools);
    this.pictures++;
    this.drawMs = performance.now() - begin;
    return true;
  }

  // The left button, one finger and the wheel are for instruments; the right button and two fingers
  // move the view.
  set holdsTools(value: boolean) {
    const { controls } = this;
    controls.mouseButtons = value
      ? { MIDDLE: MOUSE.PAN, RIGHT: MOUSE.ROTATE }
      : { LEFT: MOUSE.ROTATE, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.PAN };
    controls.touches = value
      ? { TWO: TOUCH.DOLLY_ROTATE }
      : { ONE: TOUCH.ROTATE, TWO: TOUCH.DOLLY_PAN };
    controls.enableZoom = !value;
  }
  // How the first view lies in the world, with its part of the canvas, in shares.
  rays(): { rays: Rays; part: Part } {
    const camera = this.main.drawn,
      part = this.main.part;
    camera.updateMatrixWorld();
    const m = camera.matrixWorld.elements,
      axis = (i: number, sign = 1): Vec3 => [
        sign * (m[i] ?? 0),
        sign * (m[i + 1] ?? 0),
        sign * (m[i + 2] ?? 0),
      ];
    return {
      rays: {
        eye: [camera.position.x, camera.position.y, camera.position.z],
        right: axis(0),
        up: axis(4),
        forward: axis(8, -1),
        tanHalfHeight: Math.tan((camera.fov * Math.PI) / 360),
        width: this.width * part[2],
        height: this.height * part[3],
      },
      part,
    };
  }

  // Dragging turns the view, unless it points.
  set turns(value: boolean) {
    this.controls.enabled = value;
  }

  // Returns where a ray through a place of the canvas (0 to 1 from its upper left) meets the
  // surface.
  pick(x: number, y: number): Vec3 | null {
    const hit = this.hit(x, y);
    return hit ? [hit.point.x, hit.point.y, hit.point.z] : null;
  }
  pickSurface(x: number, y: number): SurfacePlace | null {
    const hit = this.hit(x, y),
      face = hit?.face,
      shares = hit?.barycoord;
    return face && shares
      ? { corners: [face.a, face.b, face.c], shares: [shares.x, shares.y, shares.z] }
      : null;
  }
  // Where a place in the world lies on the canvas, in pixels of the page; null: behind the viewer.
  project(place: Vec3): [number, number] | null {
    const at = new Vector3(...place).project(this.main.drawn);
    return at.z > 1 ? null : this.onCanvas(at);
  }
  // From what project() gives, of the first view.
  private onCanvas(at: Vector3): [number, number] {
    const [left, top, width, height] = this.main.part;
    return [
      (left + ((at.x + 1) / 2) * width) * this.width,
      (top + ((1 - at.y) / 2) * height) * this.height,
    ];
  }
  private hit(x: number, y: number): Intersection | undefined {
    const ray = new Raycaster(),
      pane = this.panes.find((one, i) => i < this.count && one.has(x, y)) ?? this.main,
      [u, v] = pane.inside(x, y);
    ray.setFromCamera(new Vector2(u * 2 - 1, 1 - v * 2), pane.drawn);
    const { geometry } = this.organ,
      { start, count } = geometry.drawRange;
    geometry.computeBoundingSphere();
    geometry.setDrawRange(0, Infinity); // the mesh's surface is what is felt and drawn on
    const hit = ray.intersectObject(this.organ, false)[0];
    geometry.setDrawRange(start, count);
    return hit;
  }

  private setQuality(quality: number): void {
    this.quality = quality;
    const head =
      'precision highp float;\nprecision highp sampler3D;\n' +
      (quality === 0 ? '#define FINE 1\n' : '');
    const near = quality < 2 ? '#define NEAR 1\n' : '';
    this.organ.material.forEach((material, isInside) => {
      material.fragmentShader =
        head + near + (isInside ? '#define INSIDE 1\n' : '') + lightingSource + organFragmentSource;
      material.needsUpdate = true;
    });
    this.backs.material.fragmentShader = head + lightingSource + backFragmentSource;
    this.backs.material.needsUpdate = true;
    this.fine.setHead(head + near);
    this.instruments.head = head;
    this.resize(this.width, this.height);
  }
  // Lowers the quality by itself when pictures take long.
  private judge(gapMs: number): void {
    if (gapMs > 500 || document.hidden) return; // it was not the drawing
    this.gaps.push(gapMs);
    if (this.gaps.length < kJudged) return;
    const median = this.gaps.sort((a, b) => a - b)[kJudged >> 1] ?? 0;
    this.gaps = [];
    if (median > kSlowMs && this.quality < 2) this.setQuality(this.quality + 1);
  }

  private box(): [Vector3, Vector3] {
    const p = this.replica.rest(),
      low = new Vector3(1e9, 1e9, 1e9),
      high = new Vector3(-1e9, -1e9, -1e9),
      at = new Vector3();
    for (let i = 0; i + 3 < p.length; i += 4) {
      at.set(p[i] ?? 0, p[i + 1] ?? 0, p[i + 2] ?? 0);
      low.min(at);
      high.max(at);
    }
    return [low, high];
  }
  private frame(pane: Pane): void {
    const [low, high] = this.box();
    pane.frame(low.clone().add(high).multiplyScalar(0.5), high.distanceTo(low) / 2);
  }

  private loadGeometry(): void {
    const r = this.replica,
      n = r.vertexCount,
      g = this.organ.geometry;
    g.dispose();
    for (const [name, size] of [
      ['position', 3],
      ['normal', 3],
    ] as const)
      g.setAttribute(name, dynamic(new BufferAttribute(new Float32Array(n * size), size)));
    g.setAttribute('lip', dynamic(new BufferAttribute(new Int8Array(n * 4), 4, true)));
    g.setAttribute('rest', new BufferAttribute(r.rest().slice(), 4));
    g.setAttribute('overlay', dynamic(new BufferAttribute(new Uint8Array(n * 4), 4, true)));
    const triangles = r.triangles().slice(),
      outside = r.outerTriangles * 3;
    g.setIndex(new BufferAttribute(triangles, 1));
    g.clearGroups();
    g.addGroup(0, outside, 0);
    g.addGroup(outside, triangles.length - outside, 1);
    this.looks.forEach((side, isInside) => {
      const look = r.look(isInside === 1);
      side.part_dark.value = look.dark;
      side.part_light.value = look.light;
      side.lines.value = look.lines;
      side.figures.value = look.figures;
    });
    this.field.measure(...this.box());
    this.version = r.geometryVersion;
  }
  private loadPositions(): void {
    const g = this.organ.geometry;
    for (const [name, values] of [
      ['position', this.replica.positions()],
      ['normal', this.replica.normals()],
      ['lip', this.replica.lips()],
      ['overlay', this.replica.overlay()],
    ] as const) {
      const attribute = g.getAttribute(name) as BufferAttribute;
      attribute.array.set(values);
      attribute.needsUpdate = true;
    }
  }

  private light(pane: Pane): void {
    const camera = pane.drawn;
    camera.updateMatrixWorld();
    this.scene.updateMatrixWorld();
    const m = camera.matrixWorld.elements,
      u = this.uniforms;
    const direction = (right: number, up: number, back: number): Vector3 =>
      new Vector3(m[0], m[1], m[2])
        .multiplyScalar(right)
        .addScaledVector(new Vector3(m[4], m[5], m[6]), up)
        .addScaledVector(new Vector3(m[8], m[9], m[10]), back)
        .normalize();
    (u['eye']!.value as Vector3).copy(camera.position);
    (u['key_direction']!.value as Vector3).copy(
      pane.isEndoscope ? direction(0.05, 0.12, 1) : direction(0.42, 0.88, 0.55),
    );
    u['lamp']!.value = pane.isEndoscope ? kScopeLamp : 0;
    (u['fill_direction']!.value as Vector3).copy(direction(-0.9, 0.15, 0.35));
    const middle = camera.position.distanceTo(pane.target);
    (u['haze']!.value as Vector2).set(
      ...(pane.isEndoscope ? kScopeHaze : ([middle, kHazePerMiddle / middle] as const)),
    );
    (u['clip_from_world']!.value as Matrix4).multiplyMatrices(
      camera.projectionMatrix,
      camera.matrixWorldInverse,
    );
  }
}

// The organ's shader takes these beside light and view, for one side of the organ.
interface Side extends Record<string, IUniform> {
  part_dark: IUniform<Float32Array>;
  part_light: IUniform<Float32Array>;
  lines: IUniform<Float32Array>;
  figures: IUniform<Float32Array>;
}

function patternOf(replica: Replica, isInside: boolean): Data3DTexture {
  const texture = new Data3DTexture(
    replica.pattern(kPattern, isInside),
    kPattern,
    kPattern,
    kPattern,
  );
  texture.wrapS = texture.wrapT = texture.wrapR = RepeatWrapping;
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

function dynamic(attribute: BufferAttribute): BufferAttribute {
  attribute.usage = DynamicDrawUsage;
  return attribute;
}

// A browser says so before it makes a context, which takes long in software.
function isSlow(): boolean {
  return (
    document
      .createElement('canvas')
      .getContext('webgl2', { failIfMajorPerformanceCaveat: true }) === null
  );
}

function rendersInSoftware(gl: WebGLRenderingContext | WebGL2RenderingContext): boolean {
  const info = gl.getExtension('WEBGL_debug_renderer_info');
  const name = info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : '';
  return /swiftshader|llvmpipe|software/i.test(name);
}
