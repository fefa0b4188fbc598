// These are drawn beside the organ: instruments with their arrows, surgical thread, pointers, and
// the drawing on the organ.

import {
  BufferAttribute,
  BufferGeometry,
  ConstantAlphaFactor,
  CustomBlending,
  GLSL3,
  Group,
  Mesh,
  NormalBlending,
  OneMinusConstantAlphaFactor,
  Quaternion,
  RawShaderMaterial,
  Vector3,
  Vector4,
  type IUniform,
  type Scene,
} from 'three';
import { lightingSource, toolFragmentSource, toolVertexSource } from './gen/shaders';
import type { Pane } from './pane';
import type { Mesh as PlainMesh, Pointer, Replica, Shape, Tool } from './replica';

export interface Label {
  text: string;
  colour: number;
}
// The picture asks this for shapes and names, which it does not know.
export interface Guide {
  shapeOf(slot: number): Shape; // a tool's
  labelOf(tool: Tool): Label;
  pointerLabel(participant: number): string;
}

const kMetresPerNewton = 0.02,
  kMostArrow = 0.1,
  kLeastNewton = 0.05;
const kApart = 0.001; // m: hand and tool farther apart are joined by a line
const kLessonPoint = -1,
  kLessonColour = 0xf0e442; // the point to follow, beside those that people show
const kPointerLength = 0.035;
export const kShadows = 8;

interface DrawnTool {
  group: Group;
  upper: Group | null;
  lower: Group | null;
  opening: number;
  dim: IUniform<number>;
  arrows: Mesh[];
  arrowGroup: Group;
  handLine: Mesh[];
  handGroup: Group;
  label: HTMLElement;
  shape: string; // its figures, to see a change
}

interface DrawnPointer {
  group: Group;
  label: HTMLElement;
}

export class Instruments {
  head = ''; // begins their shaders
  private readonly drawnTools = new Map<number, DrawnTool>();
  private readonly drawnPointers = new Map<number, DrawnPointer>();
  private drawing: Mesh | null = null;
  private threads: Mesh | null = null;

  // `onCanvas` says where in `labels` a point lies that `pane` has projected.
  constructor(
    private readonly scene: Scene,
    private readonly uniforms: Record<string, IUniform>,
    private readonly labels: HTMLElement,
    private readonly replica: Replica,
    private readonly guide: Guide,
    private readonly pane: Pane,
    private readonly onCanvas: (at: Vector3) => [number, number],
  ) {}

  groupOf(slot: number | null): Group | undefined {
    return this.drawnTools.get(slot ?? -1)?.group;
  }
  dispose(): void {
    for (const drawn of [...this.drawnTools.values(), ...this.drawnPointers.values()])
      drawn.label.remove();
  }

  private meshOf(
    plain: PlainMesh,
    dim: IUniform<number>,
    glow = 0,
  ): Mesh<BufferGeometry, RawShaderMaterial> {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(plain.positions, 3));
    geometry.setAttribute('normal', new BufferAttribute(plain.normals, 3));
    geometry.setAttribute('material', new BufferAttribute(plain.materials, 4, true));
    const mesh = new Mesh<BufferGeometry, RawShaderMaterial>(geometry);
    mesh.frustumCulled = false;
    mesh.material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: toolVertexSource,
      fragmentShader: this.head + lightingSource + toolFragmentSource,
      uniforms: {
        ...this.uniforms,
        world_from_model: { value: mesh.matrixWorld },
        glow: { value: glow },
        dim,
      },
    });
    return mesh;
  }

  // Two meshes: one that shows faintly through tissue, one where nothing is before it.
  private arrowGroup(arrow: PlainMesh): { group: Group; meshes: Mesh[] } {
    const through = this.meshOf(arrow, { value: 1 }, 1),
      before = this.meshOf(arrow, { value: 1 }, 0.55),
      group = new Group();
    Object.assign(through.material, {
      depthTest: false,
      depthWrite: false,
      transparent: true,
      blending: CustomBlending,
      blendSrc: ConstantAlphaFactor,
      blendDst: OneMinusConstantAlphaFactor,
      blendAlpha: 0.35,
    });
    before.material.blending = NormalBlending;
    before.material.transparent = true; // after what shows through
    through.renderOrder = 1;
    before.renderOrder = 2;
    group.add(through, before);
    return { group, meshes: [through, before] };
  }

  private drawnTool(tool: Tool): DrawnTool {
    const shape = this.guide.shapeOf(tool.slot),
      text = JSON.stringify(shape),
      known = this.drawnTools.get(tool.slot);
    if (known && known.shape === text) return known;
    if (known) {
      this.scene.remove(known.group, known.arrowGroup, known.handGroup);
      known.label.remove();
    }
    const colour = this.replica.slotColour(tool.slot >> 1),
      dim: IUniform<number> = { value: 1 },
      group = new Group();
    const { body, jaw, hinge } = this.replica.makeTool(shape, colour);
    group.add(this.meshOf(body, dim));
    const made: DrawnTool = {
      group,
      upper: null,
      lower: null,
      opening: 0,
      dim,
      arrows: [],
      arrowGroup: new Group(),
      handLine: [],
      handGroup: new Group(),
      label: document.createElement('div'),
      shape: text,
    };
    if (jaw) {
      const hung = (isLower: boolean): Group => {
        const turned = new Group(),
          pivot = new Group(),
          mesh = this.meshOf(jaw, dim);
        turned.rotation.z = isLower ? Math.PI : 0;
        pivot.position.z = hinge;
        mesh.position.z = -hinge;
        pivot.add(mesh);
        turned.add(pivot);
        group.add(turned);
        return pivot;
      };
      made.upper = hung(false);
      made.lower = hung(true);
    }
    const arrow = this.arrowGroup(this.replica.makeArrow(0.02, 0.0016, colour));
    made.arrows = arrow.meshes;
    made.arrowGroup = arrow.group;
    const line = this.arrowGroup(this.replica.makeHandLine(0.02, colour));
    made.handLine = line.meshes;
    made.handGroup = line.group;
    made.label.className = 'label';
    this.labels.append(made.label);
    this.scene.add(group, made.arrowGroup, made.handGroup);
    this.drawnTools.set(tool.slot, made);
    return made;
  }

  place(tools: Tool[], seconds: number, showsArrows: boolean): void {
    this.placeTools(tools, seconds, showsArrows);
    const target = this.replica.lessonTarget();
    this.placePointers([
      ...this.replica.pointers(),
      ...(target ? [{ participant: kLessonPoint, position: target }] : []),
    ]);
    this.drawing = this.placeMesh(this.drawing, this.replica.drawing(), 0.8);
    this.threads = this.placeMesh(this.threads, this.replica.threads(), 0);
  }
  private placeTools(tools: Tool[], seconds: number, showsArrows: boolean): void {
    const shown = new Set(tools.map(t => t.slot));
    for (const [slot, drawn] of this.drawnTools)
      drawn.group.visible = drawn.arrowGroup.visible = drawn.handGroup.visible = shown.has(slot);
    const tips = this.uniforms['shadow_tip']?.value as Vector4[],
      shafts = this.uniforms['shadow_shaft']?.value as Vector4[];
    this.uniforms['shadow_count']!.value = Math.min(kShadows, tools.length);
    tools.forEach((tool, i) => {
      const drawn = this.drawnTool(tool),
        shape = this.guide.shapeOf(tool.slot);
      drawn.group.position.set(...tool.tip);
      drawn.group.quaternion.set(...tool.orientation);
      drawn.dim.value = tool.isSilent ? 0.45 : 1;
      const motion = this.replica.jawMotion(shape.form, tool.verb, tool.hasClaim);
      drawn.opening += (motion.opening - drawn.opening) * (1 - Math.exp(-seconds / motion.seconds));
      if (drawn.upper) drawn.upper.rotation.x = drawn.opening;
      if (drawn.lower) drawn.lower.rotation.x = drawn.opening;
      this.placeArrow(drawn, tool, showsArrows);
      this.placeHandLine(drawn, tool);
      if (i >= kShadows) return;
      const along = new Vector3(0, 0, 1).applyQuaternion(drawn.group.quaternion);
      tips[i]?.set(...tool.tip, shape.radiusM + 0.5 * shape.halfWidthM);
      shafts[i]?.set(along.x, along.y, along.z, shape.lengthM);
    });
  }
  private placeArrow(drawn: DrawnTool, tool: Tool, showsArrows: boolean): void {
    const force = new Vector3(...tool.forceN),
      newton = force.length();
    drawn.arrowGroup.visible = showsArrows && newton >= kLeastNewton;
    if (!drawn.arrowGroup.visible) return;
    const made = this.replica.makeArrow(
      Math.min(newton * kMetresPerNewton, kMostArrow),
      0.0016,
      this.replica.slotColour(tool.slot >> 1),
    );
    reshape(drawn.arrows, made);
    drawn.arrowGroup.position.set(...tool.tip);
    drawn.arrowGroup.quaternion.copy(
      new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), force.normalize()),
    );
  }

  private placeHandLine(drawn: DrawnTool, tool: Tool): void {
    const apart = new Vector3(...tool.hand).sub(new Vector3(...tool.tip)),
      length = apart.length();
    drawn.handGroup.visible = length > kApart;
    if (!drawn.handGroup.visible) return;
    reshape(
      drawn.handLine,
      this.replica.makeHandLine(length, this.replica.slotColour(tool.slot >> 1)),
    );
    drawn.handGroup.position.set(...tool.tip);
    drawn.handGroup.quaternion.copy(
      new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), apart.normalize()),
    );
  }

  private pointerColour(participant: number): number {
    return participant === kLessonPoint ? kLessonColour : this.replica.pointerColour(participant);
  }
  private placePointers(pointers: Pointer[]): void {
    const shown = new Map(pointers.map(p => [p.participant, p]));
    for (const [who, drawn] of this.drawnPointers)
      drawn.group.visible = !(drawn.label.hidden = !shown.has(who));
    // From above the place and from before it, as the viewer sees it.
    const m = this.pane.drawn.matrixWorld.elements,
      along = new Vector3(-m[8], -m[9], -m[10])
        .multiplyScalar(0.45)
        .sub(new Vector3(m[4], m[5], m[6]))
        .normalize();
    for (const { participant, position } of pointers) {
      let drawn = this.drawnPointers.get(participant);
      if (!drawn) {
        drawn = {
          group: this.arrowGroup(
            this.replica.makeArrow(kPointerLength, 0.0022, this.pointerColour(participant)),
          ).group,
          label: document.createElement('div'),
        };
        drawn.label.className = 'label pointer';
        this.labels.append(drawn.label);
        this.scene.add(drawn.group);
        this.drawnPointers.set(participant, drawn);
      }
      const at = new Vector3(...position);
      drawn.group.position.copy(at).addScaledVector(along, -kPointerLength);
      drawn.group.quaternion.setFromUnitVectors(new Vector3(0, 0, 1), along);
      drawn.label.textContent =
        participant === kLessonPoint ? 'Your goal' : this.guide.pointerLabel(participant);
      drawn.label.style.setProperty(
        '--own',
        `#${this.pointerColour(participant).toString(16).padStart(6, '0')}`,
      );
      at.project(this.pane.drawn);
      drawn.label.style.transform = `translate(${this.onCanvas(at)
        .map(n => `${n.toFixed(1)}px`)
        .join(', ')})`;
    }
  }

  // Shows a mesh of which there is another in each picture; null: nothing is there.
  private placeMesh(known: Mesh | null, plain: PlainMesh, glow: number): Mesh | null {
    const count = plain.positions.length / 3;
    if (known && known.geometry.getAttribute('position').count !== count) {
      this.scene.remove(known);
      known.geometry.dispose();
      known = null;
    }
    if (count === 0) return null;
    if (!known) {
      known = this.meshOf(plain, { value: 1 }, glow);
      this.scene.add(known);
      return known;
    }
    for (const [name, values] of [
      ['position', plain.positions],
      ['normal', plain.normals],
    ] as const) {
      const attribute = known.geometry.getAttribute(name) as BufferAttribute;
      attribute.array.set(values);
      attribute.needsUpdate = true;
    }
    return known;
  }

  placeLabels(tools: Tool[]): void {
    const shown = new Set<number>();
    for (const tool of tools) {
      const drawn = this.drawnTools.get(tool.slot);
      if (!drawn) continue;
      const shape = this.guide.shapeOf(tool.slot);
      const at = new Vector3(0, 0, shape.radiusM * 7)
        .applyQuaternion(drawn.group.quaternion)
        .add(drawn.group.position)
        .project(this.pane.drawn);
      if (at.z > 1 || Math.abs(at.x) > 1.05 || Math.abs(at.y) > 1.05) continue;
      shown.add(tool.slot);
      const { text, colour } = this.guide.labelOf(tool);
      if (drawn.label.textContent !== text) drawn.label.textContent = text;
      drawn.label.style.setProperty('--own', `#${colour.toString(16).padStart(6, '0')}`);
      drawn.label.style.transform = `translate(${this.onCanvas(at)
        .map(n => `${n.toFixed(1)}px`)
        .join(', ')})`;
    }
    for (const [slot, drawn] of this.drawnTools) drawn.label.hidden = !shown.has(slot);
  }
}

function reshape(meshes: Mesh[], to: PlainMesh): void {
  for (const mesh of meshes) {
    const position = mesh.geometry.getAttribute('position') as BufferAttribute;
    position.array.set(to.positions);
    position.needsUpdate = true;
  }
}
